"""The laboratory: simulator, benchmarks, experiments and others' matchers. No product needs it."""
