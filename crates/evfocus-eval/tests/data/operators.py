"""Makes operators.json: small pictures and what an independent implementation of the eleven operators says of them.

Needs NumPy, SciPy, OpenCV and PyWavelets from PyPI. Run it in this folder: python operators.py
"""

import json

import cv2
import numpy as np
import pywt
from scipy import ndimage

WINDOW = 15


def cheb(image):
    scaled = image / np.linalg.norm(image)
    scaled = scaled - scaled.mean()

    def basis(count):
        # Columns of Q span the polynomials of degree 0, 1, 2 on `count` points.
        return np.linalg.qr(np.vander(np.linspace(-1, 1, count), 3, increasing=True))[0].T

    moments = basis(image.shape[0]) @ scaled @ basis(image.shape[1]).T
    order = np.add.outer(np.arange(3), np.arange(3))
    low = (moments[order <= 2] ** 2).sum()
    return abs((scaled**2).sum() - low) / low


def helm(image):
    mean = cv2.blur(image, (WINDOW, WINDOW), borderType=cv2.BORDER_REPLICATE)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.maximum(image / mean, mean / image)
    return np.where(image > 0, ratio, 1).mean()


def eigv(image):
    scaled = image / np.linalg.norm(image)
    singular = np.linalg.svd(scaled - scaled.mean(), compute_uv=False)
    return (singular[:3] ** 2).sum() / (image.size - 1)


def gllv(image):
    local = ndimage.generic_filter(image, np.var, size=WINDOW, mode="nearest")
    return local.var()


SECOND = np.array([[-1.0, 2.0, -1.0]])


def size_of(image, weights):
    return np.abs(ndimage.correlate(image, weights, mode="nearest")).mean()


def sml(image):
    return size_of(image, SECOND) + size_of(image, SECOND.T)


def lap3(image):
    diagonal = np.diag([-1.0, 2.0, -1.0]) / np.sqrt(2)
    return sml(image) + size_of(image, diagonal) + size_of(image, diagonal[::-1])


def grad(image):
    x = cv2.Sobel(image, cv2.CV_64F, 1, 0, borderType=cv2.BORDER_REPLICATE)
    y = cv2.Sobel(image, cv2.CV_64F, 0, 1, borderType=cv2.BORDER_REPLICATE)
    return (x**2 + y**2).mean()


def wavs(image):
    _, details = pywt.dwt2(image, "db6", mode="symmetric")
    return sum(np.abs(band).mean() for band in details)


def acmo(image):
    levels = np.rint(image * 255).astype(int)
    histogram = np.bincount(levels.ravel(), minlength=256) / image.size
    grey = np.arange(256)
    return (np.abs(grey - (grey * histogram).sum()) * histogram).sum()


def sfil(image):
    reach = WINDOW // 2
    sigma = reach / 3
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    gaussian = np.exp(-(x**2 + y**2) / (2 * sigma**2)) / (2 * np.pi * sigma**2)
    right = ndimage.correlate(image, x / sigma**2 * gaussian, mode="nearest")
    down = ndimage.correlate(image, y / sigma**2 * gaussian, mode="nearest")
    angles = np.arange(8) * np.pi / 4
    return np.max([np.cos(a) * right + np.sin(a) * down for a in angles], axis=0).mean()


def dctm(image):
    mask = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.ones((2, 2)))
    padded = np.pad(image, ((1, 2), (1, 2)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (4, 4))
    return (np.einsum("yxij,ij->yx", windows, mask) ** 2).mean()


OPERATORS = {
    "CHEB": (cheb, 3), "HELM": (helm, WINDOW), "EIGV": (eigv, 3), "GLLV": (gllv, WINDOW), "SML": (sml, 3), "LAP3": (lap3, 3),
    "GRAD": (grad, 3), "WAVS": (wavs, 12), "ACMO": (acmo, 2), "SFIL": (sfil, WINDOW), "DCTM": (dctm, 4),
}


def pictures():
    random = np.random.default_rng(20221)
    yield "random 8 x 8", random.integers(0, 256, (8, 8))
    yield "random 16 x 16", random.integers(0, 256, (16, 16))
    yield "smooth 20 wide, 17 high", np.rint(
        cv2.GaussianBlur(random.integers(0, 256, (17, 20)).astype(float), (0, 0), 1.5)
    ).astype(int)
    yield "random 31 wide, 24 high", random.integers(0, 256, (24, 31))
    step = np.full((16, 16), 51)
    step[:, 8:] = 204
    yield "step", step


def main():
    cases = []
    for name, levels in pictures():
        image = levels / 255.0
        values = {
            operator: float(function(image))
            for operator, (function, smallest) in OPERATORS.items()
            if min(image.shape) >= smallest
        }
        cases.append({"name": name, "width": image.shape[1], "levels": levels.ravel().tolist(), "values": values})
    with open("operators.json", "w", encoding="utf-8") as file:
        json.dump({"pictures": cases}, file, separators=(",", ":"))
        file.write("\n")


if __name__ == "__main__":
    main()
