"""What the service says about itself: figures for Prometheus, and its log.

`durations` travel from the workers, `latency` is from accepted to mapped, `metrics` puts all
figures together, `requests` sees every request, `log` writes lines.
"""
