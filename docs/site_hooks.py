"""What mkdocs does beyond its plugins: pages of the planners from their files, and links that leave docs/.

- planners/NAME.md is made of the docstring and the settings of a planner, with images/planners/NAME.png, and
  stands in the navigation under "Planners";
- changelog.md and contributing.md are CHANGELOG.md and CONTRIBUTING.md of the repository;
- a link to a file that is in the repository and not on the site is shown as the file's name. One to a file that is
  nowhere stays as it is, and mkdocs complains of it.
"""

from __future__ import annotations

import ast
import posixpath
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PAGES_OF_THE_ROOT = {"changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md"}
CAPTION = (
    "*The car at 3 m/s before a box in `chicanes`, the same place for every planner. Left from above, right the range "
    "of each beam. The arc is the planner's reference: the safety filter and the friction limiter come after it. "
    "Made by `python docs/diagrams`.*"
)


def planner_files() -> dict[str, Path]:
    """Return the files of the planners that have a page: those of controllers/ and of the add-ons."""
    places = {name: f"controllers/{place}" for name, place in catalogue("controllers", "CONTROLLERS").items()}
    for name, place in catalogue("addons", "PLANNERS").items():
        places[name] = f"addons/{place.partition(':')[0].replace('.', '/')}"
    return {name: ROOT / f"{place.partition(':')[0]}.py" for name, place in sorted(places.items())}


def planner_names() -> list[str]:
    """Return the names of the planners that have a page."""
    return list(planner_files())


def catalogue(folder: str, name: str) -> dict[str, str]:
    """Return a table of names that stands in the __init__.py of a folder, without importing it."""
    module = ast.parse((ROOT / folder / "__init__.py").read_text("utf-8"))
    (table,) = (n.value for n in module.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == name)
    return dict(ast.literal_eval(table))


def planner_page(name: str) -> str:
    """Return the page of a planner, as Markdown."""
    from fg_mujoco.controllers.control.driving import DrivingSettings
    from fg_mujoco.racing.planners import find_controller

    docstring = ast.get_docstring(parsed(name)[1])
    assert docstring, name
    title, _, rest = docstring.partition("\n")
    settings = settings_table(find_controller(name).Settings, but=DrivingSettings)
    return f"""# {name}

**{title.strip()}**

![What {name} makes of a scan](../images/planners/{name}.png)

{CAPTION}

## How it works

{as_markdown(rest)}

## Its settings

`fg-mujoco race --controller '{name}[SETTING=VALUE,...]'`, or `planner_settings={{...}}` of `fg.race`.

{settings}

Those that every planner has, with the defaults of `DrivingSettings` unless the table above says otherwise:

{settings_table(DrivingSettings)}

[The bundled planners](../planners.md) are compared on one page. The file of this one is
`{planner_files()[name].relative_to(ROOT).as_posix()}`.
"""


def parsed(name: str) -> tuple[str, ast.Module]:
    """Return the source of a planner's module, and its tree."""
    source = planner_files()[name].read_text("utf-8")
    return source, ast.parse(source)


def settings_table(kind: type, *, but: type | None = None) -> str:
    """Return a table of the settings of a dataclass; with `but`, without those that are as in that dataclass."""
    from fg_mujoco.cli.lists import describe_settings, value_text

    known = [] if but is None else describe_settings(but)
    rows = ["| setting | default | what |", "| --- | --- | --- |"]
    for each in describe_settings(kind):
        if each not in known:
            scaled = "; scaled to other cars" if each["scales"] else ""
            accepted = f" ({each['accepted']})" if each["accepted"] else ""
            value = f"{value_text(each['default'])} {each['unit']}".strip()
            rows.append(f"| `{each['name']}` | {value}{scaled} | {each['text']}{accepted} |")
    return "\n".join(rows)


def as_markdown(docstring: str) -> str:
    """Return the text of a docstring as Markdown.

    Its lists are indented by three, where Markdown wants four, and items after a block of formulas need an empty line;
    columns are set apart by spaces.
    """
    lines: list[str] = []
    for line in docstring.strip("\n").splitlines():
        if re.match(r"\d\. ", line) and lines and lines[-1]:
            lines.append("")
        in_list = re.match(r" {3}(?! )| {7,}", line)  # four to six are a block of formulas by itself
        line = f" {line}" if in_list else line
        line = re.sub(r"(\S) {2,}(?=\S)(?!.*#)", r"\1: ", line) if re.match(r"\s*\d\. ", line) else line
        lines.append(line)
    return "\n".join(lines)


def without_links_out(markdown: str, folder: str, *, to_docs: bool = False) -> str:
    """Return a page whose links to files of the repository outside docs/ are their names.

    Args:
      markdown: of the page.
      folder: of the page, in the repository.
      to_docs: whether the page is shown as if it were in docs/; links to docs/ are then made to fit.
    """

    def replaced(match: re.Match[str]) -> str:
        text, target = match.groups()
        if "://" in target or target.startswith("#"):
            return match[0]
        path = posixpath.normpath(posixpath.join(folder, target.partition("#")[0]))
        if path.startswith("docs/"):
            return f"[{text}]({target.removeprefix('docs/')})" if to_docs else match[0]
        if path in PAGES_OF_THE_ROOT.values():
            page = next(name for name, source in PAGES_OF_THE_ROOT.items() if source == path)
            return f"[{text}]({posixpath.relpath(page, folder.removeprefix('docs').strip('/') or '.')})"
        return (text if text.startswith("`") else f"`{text}`") if (ROOT / path).exists() else match[0]

    return re.sub(r"(?<!!)\[([^\]\n]+)\]\(([^)\s]+)\)", replaced, markdown)


def on_config(config: Any) -> Any:
    """Add the pages of the planners to the navigation."""
    (section,) = (part["Planners"] for part in config["nav"] if "Planners" in part)
    section += [f"planners/{name}.md" for name in planner_names()]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are made."""
    from mkdocs.structure.files import File

    for name in planner_names():
        files.append(File.generated(config, f"planners/{name}.md", content=planner_page(name)))
    for page, source in PAGES_OF_THE_ROOT.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text("utf-8")))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Take the links out that lead nowhere on the site."""
    path = page.file.src_uri
    of_the_root = path in PAGES_OF_THE_ROOT
    return without_links_out(markdown, "" if of_the_root else posixpath.dirname(f"docs/{path}"), to_docs=of_the_root)
