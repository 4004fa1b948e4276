"""Archives for the benchmarks' servers: one module a benchmark says what its server takes."""
