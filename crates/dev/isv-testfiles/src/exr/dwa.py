"""Writes dwaa.exr and dwab.exr: 8 x 6 pixels, depths of 1 m and more in steps of 1/16 m. Needs `pip install OpenEXR`."""

import numpy
import OpenEXR

depths = (1 + numpy.arange(48) % 16 / 16).reshape(6, 8)
channels = {name: depths.astype("float16") for name in "RGBAY"} | {"Z": depths.astype("float32")}
for name, compression in {"dwaa": OpenEXR.DWAA_COMPRESSION, "dwab": OpenEXR.DWAB_COMPRESSION}.items():
    header = {"compression": compression, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as file:
        file.write(f"{name}.exr")
