"""Ends with 0 where the service in this container is ready, and says why not where it is not."""

from __future__ import annotations

import os
import ssl
import sys
import urllib.error
import urllib.request


def main() -> int:
    """Ask `/readyz` on this machine. A certificate is for the outer name: it is not checked."""
    secure = bool(os.environ.get("LINELOOM_SSL_CERTFILE"))
    port = os.environ.get("LINELOOM_PORT", "8765")
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    url = f"http{'s' if secure else ''}://127.0.0.1:{port}/readyz"
    try:
        with urllib.request.urlopen(url, timeout=4.0, context=context if secure else None):
            return 0
    except urllib.error.HTTPError as error:
        print(error.read().decode("utf-8", "replace"))
    except OSError as error:
        print(f"no answer: {error}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
