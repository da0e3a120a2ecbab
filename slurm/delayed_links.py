"""Links between the nodes of a throw-away cluster on which every frame arrives late.

    slurm/test-cluster.sh start FOLDER --nodes 3
    python slurm/delayed_links.py FOLDER MILLISECONDS &
    OMPI_MCA_btl_tcp_if_include=late srun --mpi=pmix -N3 -n3 ...

Each node gets a second network device, `late`. This process hands frames on from one to another,
MILLISECONDS later each way, until it is ended. It takes the place of `tc qdisc ... netem delay`,
which some kernels lack. It needs root, and takes a core whenever a frame is due.
"""

import ctypes
import fcntl
import os
import select
import struct
import subprocess
import sys
import time
from collections import deque
from pathlib import Path

DEVICE = "late"
_NETWORK = "10.99.0"
_CLONE_NEWNET = 0x40000000
_TUNSETIFF, _TUNSETOFFLOAD = 0x400454CA, 0x400454D0
_TAP_WITH_HEADERS = 0x0002 | 0x1000 | 0x4000  # IFF_TAP, IFF_NO_PI, IFF_VNET_HDR
_ALL_OFFLOADS = 7  # checksums and segments are left to who receives: frames of up to 64 kB
_HEADER, _ADDRESS, _LARGEST = 10, 6, 70_000
_FRAMES_AT_ONCE = 64


def enter_network(process: str) -> None:
    """Have this process see the network of another one. Raises OSError if it may not."""
    libc = ctypes.CDLL(None, use_errno=True)
    handle = os.open(f"/proc/{process}/ns/net", os.O_RDONLY)
    try:
        if libc.setns(handle, _CLONE_NEWNET):
            raise OSError(ctypes.get_errno(), f"cannot enter the network of process {process}")
    finally:
        os.close(handle)


def open_device(number: int) -> tuple[int, bytes]:
    """A device of the present network: where its frames are read and written, and its address."""
    handle = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    name = DEVICE.encode()
    fcntl.ioctl(handle, _TUNSETIFF, struct.pack("16sH22x", name, _TAP_WITH_HEADERS))
    fcntl.ioctl(handle, _TUNSETOFFLOAD, _ALL_OFFLOADS)
    address = bytes([2, 0, 0, 0, 0, number])
    for words in (
        f"link set {DEVICE} address {address.hex(':')} txqueuelen 5000",
        f"addr add {_NETWORK}.{number}/24 dev {DEVICE}",
        f"link set {DEVICE} up",
    ):
        subprocess.run(["ip", *words.split()], check=True)
    return handle, address


def hand_on(devices: dict[bytes, int], delay: float) -> None:
    """Hand frames on after `delay` [s], for ever; those to no device's address go to all."""
    handles = list(devices.values())
    waiting: deque[tuple[float, int, bytes]] = deque()
    while True:
        while waiting and waiting[0][0] <= time.monotonic():
            _, sender, frame = waiting.popleft()
            receiver = devices.get(frame[_HEADER : _HEADER + _ADDRESS])
            others = [handle for handle in handles if handle != sender]
            for handle in others if receiver is None else [receiver]:
                os.write(handle, frame)
        pause = max(waiting[0][0] - time.monotonic(), 0.0) if waiting else None
        for handle in select.select(handles, [], [], pause)[0]:
            for _ in range(_FRAMES_AT_ONCE):
                try:
                    frame = os.read(handle, _LARGEST)
                except BlockingIOError:
                    break
                waiting.append((time.monotonic() + delay, handle, frame))


def main(folder: str, milliseconds: str) -> None:
    """Make the devices of all nodes of the cluster in a folder, and hand frames on."""
    devices: dict[bytes, int] = {}
    for number, file in enumerate(sorted(Path(folder).glob("n*.init")), start=1):
        enter_network(file.read_text().split()[0])
        handle, address = open_device(number)
        devices[address] = handle
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    hand_on(devices, float(milliseconds) / 1e3)


if __name__ == "__main__":
    main(*sys.argv[1:])
