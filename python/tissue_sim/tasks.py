"""Work that many processes share, on this machine or on others: tasks of Dask."""
import contextlib
import os
import sys
import time


@contextlib.contextmanager
def client_of(scheduler=None, processes=None):
    """A client of the scheduler at this address, or of worker processes of this machine alone, a
    thread each."""
    from distributed import Client, LocalCluster
    if scheduler:
        with Client(scheduler, timeout=30) as client:
            yield client
        return
    with LocalCluster(n_workers=processes or os.cpu_count(), threads_per_worker=1, processes=True,
                      dashboard_address=None) as cluster, Client(cluster) as client:
        yield client


def run_tasks(client, function, items, done=None):
    """function(item) of each, in the order of items; done(finished, of_all) as they end. The tasks
    of a worker that dies are done again by another; a task that throws, or whose workers died four
    times, throws here."""
    from distributed import as_completed
    futures = client.map(function, items, pure=False, retries=2)
    place = {future.key: i for i, future in enumerate(futures)}
    results = [None] * len(items)
    for finished, (future, result) in enumerate(as_completed(futures, with_results=True), 1):
        results[place[future.key]] = result
        if done:
            done(finished, len(items))
    return results


class Progress:
    """Says on stderr how far it is."""

    def __init__(self):
        self.begin, self.said = time.monotonic(), 0.0

    def __call__(self, finished, of_all):
        now = time.monotonic()
        on_terminal = sys.stderr.isatty()
        if finished < of_all and now - self.said < (0.2 if on_terminal else 10):
            return
        self.said = now
        left = (now - self.begin) / finished * (of_all - finished)
        print("%s%d of %d, %.0f s to go " % ("\r" if on_terminal else "", finished, of_all, left),
              end="" if on_terminal and finished < of_all else "\n", file=sys.stderr, flush=True)
