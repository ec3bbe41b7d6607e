"""What a photo costs a server, in processor time and memory: python benchmarks/photo_cost.py [--photos 5] [--workers 1]

Starts `anyprobe serve`, sends it photos one after another, without a mask (the example's .jpg) and with one (an alpha
channel), and prints one JSON object: seconds of processor time a photo of all its processes, which other programs on
the machine hardly change, and MB that they hold together, pages that they share counted once (Linux).
"""

from __future__ import annotations

import argparse
import json
import socket
import statistics
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

from measure import tree, used_s
from serve_load import own_question

ROOT = Path(__file__).resolve().parents[1]
PHOTOS = {"without_mask": ROOT / "examples" / "table.jpg", "with_mask": ROOT / "examples" / "vase.png"}


def held_mb(root: int) -> float:
    """Return memory that the processes hold, shared pages once."""
    texts = [Path(f"/proc/{one}/smaps_rollup").read_text() for one in tree(root)]
    return sum(int(text.partition("\nPss:")[2].split()[0]) for text in texts) / 1024


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=int, default=5, help="of each kind")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    order = [sys.executable, "-m", "anyprobe", "serve", "--port", str(port), "--workers", str(given.workers)]
    server = subprocess.Popen(order, stderr=subprocess.DEVNULL)
    base, found = f"http://127.0.0.1:{port}", {"workers": given.workers}
    try:
        while True:
            try:
                urllib.request.urlopen(f"{base}/readyz").close()
                break
            except OSError:
                time.sleep(0.2)
        found["idle_mb"] = round(held_mb(server.pid))
        for kind, path in PHOTOS.items():
            seconds = []
            for count in range(given.photos + 1):
                before = used_s(server.pid)
                asked = own_question(path)
                posted = urllib.request.Request(f"{base}{asked.path}", asked.body, {"Content-Type": asked.kind})
                with urllib.request.urlopen(posted, timeout=600) as answer:
                    network = json.load(answer)["mask"]
                if count:  # the first opens networks
                    seconds.append(used_s(server.pid) - before)
            found[f"{kind}_core_s"] = round(statistics.median(seconds), 2)
            found[f"{kind}_source"] = network["source"]
            found[f"{kind}_mb"] = round(held_mb(server.pid))
    finally:
        server.kill()
    print(json.dumps(found))


if __name__ == "__main__":
    main()
