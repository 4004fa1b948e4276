"""A package from elsewhere, as the page "Extend it" shows one: a stage and a dataset."""
