"""`python -m lineloom_service.engine`: a worker process, as `worker_process` starts it."""

import sys

from lineloom_service.engine.worker import run_worker

if __name__ == "__main__":
    mapper, warm_up, publish_every_s, settle_after_s, pipe, life, current = sys.argv[1:]
    run_worker(
        mapper,
        warm_up or None,
        float(publish_every_s),
        float(settle_after_s),
        pipe=int(pipe),
        life=int(life),
        current=int(current),
    )
