"""The one door to open3d.

open3d links against libusb for sensors we do not use it with. Loading the copy that the `libusb-package` wheel
brings, before open3d asks for it, spares a system package.
"""

import ctypes

import libusb_package

ctypes.CDLL(str(libusb_package.get_library_path()), ctypes.RTLD_GLOBAL)

import open3d  # noqa: E402

__all__ = ["open3d"]
