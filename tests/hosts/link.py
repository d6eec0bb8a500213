"""Links between network namespaces that lose and delay packets on request.

    link.py HUB SPOKE...

Every SPOKE namespace gets a device that is joined to one in HUB: 10.77.N.1 in HUB, 10.77.N.2 in the Nth SPOKE, N from 1. The packets
pass through this program, which knows no kernel modules: a line `N LOSS DELAY` on standard input sets the share of packets of link N
that are lost (1 cuts it) and the mean delay of the others in seconds; each is delayed by half to one and a half of that, so that
packets overtake each other. Prints `ready` when the devices exist. Needs root and /dev/net/tun.
"""

import ctypes
import fcntl
import heapq
import os
import random
import selectors
import struct
import subprocess
import sys
import time

TUNSETIFF, IFF_TUN, IFF_NO_PI, CLONE_NEWNET = 0x400454CA, 1, 0x1000, 0x40000000
libc = ctypes.CDLL(None, use_errno=True)


def enter(namespace):
    with open(f"/run/netns/{namespace}") as place:
        if libc.setns(place.fileno(), CLONE_NEWNET) != 0:
            raise OSError(ctypes.get_errno(), f"setns {namespace}")


def device(namespace, name, own, other):
    enter(namespace)
    tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tun, TUNSETIFF, struct.pack("16sH22s", name.encode(), IFF_TUN | IFF_NO_PI, b""))
    for words in (["addr", "add", own, "peer", other, "dev", name], ["link", "set", name, "up"], ["link", "set", "lo", "up"]):
        subprocess.run(["ip", *words], check=True)
    return tun


def main():
    hub, *spokes = sys.argv[1:]
    ends = {}
    loss, delay = {}, {}
    for number, spoke in enumerate(spokes, start=1):
        here, there = f"10.77.{number}.1", f"10.77.{number}.2"
        near = device(hub, f"s{number}", here, there)
        far = device(spoke, "hub", there, here)
        subprocess.run(["ip", "route", "add", "default", "dev", "hub"], check=True)
        ends[near], ends[far] = (number, far), (number, near)
        loss[number], delay[number] = 0.0, 0.0
    enter(hub)
    with open("/proc/sys/net/ipv4/ip_forward", "w") as forward:
        forward.write("1")
    dice = random.Random(int(os.environ.get("LINK_SEED", "1")))
    watch = selectors.DefaultSelector()
    for tun in ends:
        watch.register(tun, selectors.EVENT_READ)
    os.set_blocking(0, False)
    watch.register(0, selectors.EVENT_READ)
    print("ready", flush=True)
    late, count, pending = [], 0, b""

    def deliver(tun, packet):
        try:
            os.write(tun, packet)
        except OSError:
            pass  # a full queue loses packets, as networks do

    while True:
        wait = max(0.0, late[0][0] - time.monotonic()) if late else None
        for key, _ in watch.select(wait):
            if key.fd == 0:
                text = os.read(0, 4096)
                if not text:
                    return
                *lines, pending = (pending + text).split(b"\n")
                for line in lines:
                    number, lost, slow = line.split()
                    loss[int(number)], delay[int(number)] = float(lost), float(slow)
                continue
            number, other = ends[key.fd]
            for _ in range(64):
                try:
                    packet = os.read(key.fd, 65536)
                except BlockingIOError:
                    break
                if loss[number] and dice.random() < loss[number]:
                    continue
                if delay[number]:
                    count += 1
                    until = time.monotonic() + delay[number] * (0.5 + dice.random())
                    heapq.heappush(late, (until, count, other, packet))
                else:
                    deliver(other, packet)
        now = time.monotonic()
        while late and late[0][0] <= now:
            _, _, tun, packet = heapq.heappop(late)
            deliver(tun, packet)


if __name__ == "__main__":
    main()
