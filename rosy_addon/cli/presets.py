"""The command `presets`: list the presets of looks."""

import json
from typing import Any

from ..core.errors import RosyError
from ..preset_files.store import merge_preset_files, read_preset, user_preset_files
from .options import Options, add_subcommand, user_presets_folder
from .streams import print_error, print_line


def add_presets_command(subparsers: Any) -> None:
    """Add the command `presets`."""
    parser = add_subcommand(subparsers, run_presets)
    parser.add_switch("--json", "print a JSON list of objects")


def run_presets(options: Options) -> None:
    """List the presets of RoSy and your own, with their descriptions."""
    folder, records = user_presets_folder(), []
    for key, path in merge_preset_files(user_preset_files(folder)).items():
        try:
            preset = read_preset(path)
        except RosyError as error:
            print_error(str(error))
            continue
        facts = {"preset": key, "name": preset.name, "description": preset.description}
        records.append(facts | {"own": path.parent == folder})
    if options.json:
        print_line(json.dumps(records))
        return
    width = max(len(record["preset"]) for record in records)
    for record in records:
        note = "  (own)" * record["own"]
        print_line(f"{record['preset']:{width}}  {record['description']}{note}")
    print_line(f"Your presets are in {folder}")
