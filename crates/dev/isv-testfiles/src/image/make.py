"""Makes the images beside this file, of 16 x 16 pixels. Needs Pillow and alktx2, which holds the encoder of Basis Universal."""

import os

import alktx2
from PIL import Image

HERE = os.path.dirname(os.path.abspath(__file__))
SIDE = 16


def path(name):
    return os.path.join(HERE, name)


# Red grows to the right, green down: 8 to 248.
gradient = Image.new("RGB", (SIDE, SIDE))
gradient.putdata([(16 * x + 8, 16 * y + 8, 128) for y in range(SIDE) for x in range(SIDE)])
gradient.save(path("rgb.jpg"), quality=95, subsampling=0)
gradient.save(path("progressive.jpg"), quality=95, subsampling=0, progressive=True)
gradient.convert("L").save(path("grey.jpg"), quality=95)
gradient.convert("CMYK").save(path("cmyk.jpg"), quality=95)
gradient.save(path("lossy.webp"), quality=95)
gradient.save(path("lossless.webp"), lossless=True)
transparent = gradient.copy()
transparent.putalpha(Image.linear_gradient("L").resize((SIDE, SIDE)))
transparent.save(path("alpha.webp"), quality=95)
gradient.save(path("source.png"))
alktx2.encode_image_to_ktx2(path("source.png"), path("etc1s.ktx2"), codec="etc1s", quality=100)
alktx2.encode_image_to_ktx2(
    path("source.png"), path("uastc.ktx2"), codec="uastc", zstd_supercompression_level=9, mipmaps=True
)
alktx2.encode_image_to_ktx2(path("source.png"), path("astc.ktx2"), codec="astc_ldr")
os.remove(path("source.png"))
