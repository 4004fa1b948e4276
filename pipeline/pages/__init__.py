"""HTML pages: the report and the viewer."""
