"""From a stream of scans to poses, places and one map per site."""
