"""The side of the benchmark that keeps the measurements: sets, splits, the protocol, scores, tables."""
