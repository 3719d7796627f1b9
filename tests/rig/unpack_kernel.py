"""Writes the kernel that is packed into a Linux boot image.

usage: unpack_kernel.py VMLINUZ VMLINUX
"""

import lzma
import subprocess
import sys

# How the packings that Debian has used begin, and what unpacks them.
PACKINGS = [(b"\xfd7zXZ\x00", "xz"), (b"\x28\xb5\x2f\xfd", "zstd"), (b"\x1f\x8b\x08", "gzip")]


def unpacked(image: bytes) -> bytes:
    for magic, program in PACKINGS:
        start = image.find(magic)
        while start >= 0:
            if program == "xz":
                # Other data stands behind it, which xz would complain of.
                try:
                    kernel = lzma.LZMADecompressor().decompress(image[start:])
                except lzma.LZMAError:
                    kernel = b""
            else:
                unpack = subprocess.run([program, "-dc"], input=image[start:], capture_output=True, check=False)
                kernel = unpack.stdout
            if kernel.startswith(b"\x7fELF"):
                return kernel
            start = image.find(magic, start + 1)
    raise SystemExit("unpack_kernel.py: no packed kernel found; is this a vmlinuz of another packing?")


def main() -> None:
    image, kernel = sys.argv[1:]
    with open(image, "rb") as file:
        content = unpacked(file.read())
    with open(kernel, "wb") as file:
        file.write(content)


if __name__ == "__main__":
    main()
