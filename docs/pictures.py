"""Take pictures that an example of the gallery writes, `hpcsweep plot` say, into its page."""

import shutil
from pathlib import Path

from sphinx_gallery.scrapers import figure_rst


def written(block, block_vars, gallery_conf):
    """Return the reST of the PNGs that a block has written beside its script; they are moved."""
    del block
    taken = []
    for picture in sorted(Path(block_vars["src_file"]).parent.glob("*.png")):
        target = next(block_vars["image_path_iterator"])
        shutil.move(picture, target)
        taken.append(target)
    return figure_rst(taken, gallery_conf["src_dir"])
