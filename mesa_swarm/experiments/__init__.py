"""Many runs: finding models, comparing values of a parameter, statistics, tables, pictures and benchmarks."""
