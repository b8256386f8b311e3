# SPDX-License-Identifier: Apache-2.0
"""Resolution of mesh paths of a URDF, within allowed folders.

The simulation opens the files named by a URDF, so only paths below a few roots are accepted: the
URDF's own folder (or its ROS package), the shares of ROS packages, pybullet_data and icub-models,
and for ``package://NAME/`` a folder NAME above the URDF.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

from ..urdf_xml import share_folders

#: Folders above a URDF that are looked at for the package of a mesh.
LEVELS = 6


class MeshPathError(ValueError):
    """A disallowed mesh path; one line without the URDF's name."""


def package_folder(module: str) -> Path | None:
    """The folder of an installed Python package, without importing it."""
    spec = find_spec(module)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))


def source_package(folder: Path) -> Path | None:
    """The ROS package of this folder: the nearest parent with a package.xml."""
    for candidate in (folder, *folder.parents):
        if (candidate / "package.xml").is_file():
            return candidate
    return None


def above(folder: Path, package: str) -> Path | None:
    """The nearest folder above this one that has a package's name; none that holds a home."""
    home = Path(os.path.expanduser("~"))  # unchanged for unknown users
    for candidate in folder.resolve().parents[:LEVELS]:
        if home.is_relative_to(candidate) or candidate == candidate.parent:
            return None
        if candidate.name == package:
            return candidate
    return None


def mesh_url(path: Path) -> str:
    """The URL of a mesh: ``package://`` for installed ROS packages, valid on other hosts too."""
    for share in share_folders():
        if not path.is_relative_to(share):
            continue
        package, *inside = path.relative_to(share).parts
        if inside and (share / "ament_index" / "resource_index" / "packages" / package).is_file():
            return f"package://{package}/{'/'.join(inside)}"
    return f"file://{path}"


class MeshFinder:
    """Finds the meshes of the URDF in one folder.

    Args:
        folder: The URDF's folder, absolute.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        package = source_package(folder)
        # Files beside the URDF must really be there; an installed share may be links into
        # a workspace (colcon build --symlink-install).
        self.near_roots = [folder] + ([package] if package else [])
        self.installed = share_folders()
        data = package_folder("pybullet_data")
        if data is not None:
            self.installed.append(data)

    def find(self, name: str) -> Path | None:
        """The file of a mesh path of a URDF; None if it does not exist.

        Raises:
            MeshPathError: the path is a URL, or leads out of the allowed folders.
        """
        if "\0" in name or len(name) > 4096:
            raise MeshPathError(f"mesh path {name[:40]!r}… is not a path")
        scheme, mark, rest = name.partition("://")
        if not mark:
            candidates = [self.folder / name]
        elif scheme in ("package", "model"):
            candidates = self._in_package(unquote(rest))
        elif scheme == "file":
            candidates = [Path("/" + unquote(rest).lstrip("/"))]
        else:
            raise MeshPathError(
                f"mesh {name!r} is not allowed; use a relative path, package:// or file://, "
                "and put the file beside the URDF"
            )
        places = [Path(os.path.normpath(path)) for path in candidates]
        package = rest.partition("/")[0] if scheme in ("package", "model") and mark else ""
        top = above(self.folder, package) if package else None
        roots = self.near_roots if top is None else [*self.near_roots, top]
        allowed = [path for path in places if self._allowed(path, roots)]
        if not allowed:
            raise MeshPathError(
                f"mesh {name!r} is outside the folders that meshes may come from; put it "
                f"below {self.folder} or into a ROS package"
            )
        return next((path for path in allowed if path.is_file()), None)

    def _in_package(self, path: str) -> list[Path]:
        package, _, inside = path.partition("/")
        if package in ("", ".", ".."):
            raise MeshPathError(f"mesh 'package://{path}' names no package")
        candidates = [share / package / inside for share in self.installed]
        candidates += [root / inside for root in self.near_roots if root.name == package]
        if (top := above(self.folder, package)) is not None:
            candidates.append(top / inside)
        # pybullet_data writes package://meshes/… for a folder beside the URDF.
        return [*candidates, self.folder / package / inside]

    def _allowed(self, path: Path, roots: Sequence[Path]) -> bool:
        if any(path.is_relative_to(root) for root in self.installed):
            return True
        if not any(path.is_relative_to(root) for root in roots):
            return False
        real = path.resolve()
        return any(real.is_relative_to(root.resolve()) for root in roots)


def not_found(names: Sequence[str]) -> str:
    """One line about meshes that do not exist, with the next step."""
    count = "mesh" if len(names) == 1 else f"{len(names)} meshes"
    packages = [n.partition("://")[2].partition("/")[0] for n in names if "://" in n]
    if packages:
        package = max(packages, key=packages.count)
        remedy = (
            f"put the URDF below a folder {package!r}, or name in AMENT_PREFIX_PATH a folder with "
            f"share/{package}"
        )
    else:
        remedy = "put them beside the URDF, at these paths"
    kept = "the shapes are not drawn and do not collide, masses and joints stay"
    return f"{count} not found, as {names[0]!r}: {kept}; {remedy}"
