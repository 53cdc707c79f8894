"""Commands, one module each: ``add_arguments(parser)`` and ``run(args) -> int``. None imports an extra before it runs."""

from __future__ import annotations

from pathlib import Path

from .._errors import wrong


def write_all(files: dict[Path, str | bytes], force: bool) -> None:
    """Write files, all or none: one that is there with another content is kept unless ``force``."""
    for path, content in files.items():
        data = content.encode("utf-8") if isinstance(content, str) else content
        if path.exists() and not force and (path.is_dir() or path.read_bytes() != data):
            raise wrong(path.name, f"{path} is there, and is another", "name another, or say --force")
    for path, content in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
