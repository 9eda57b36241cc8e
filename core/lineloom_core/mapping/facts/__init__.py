"""What robots' scans show by themselves: keyframes and how each was tracked. No belief enters."""
