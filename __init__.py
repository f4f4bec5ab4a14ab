"""The entry point of the Blender extension: registration."""

_cli_command = None


def register() -> None:
    """Add RoSy's classes, properties and command to Blender."""
    global _cli_command
    import bpy

    from .operators import registration as operators
    from .rosy_addon.cli.parser import main_in_extension
    from .rosy_addon.ui import registration as ui

    ui.register()
    operators.register()
    _cli_command = bpy.utils.register_cli_command("rosy", main_in_extension)


def unregister() -> None:
    """Remove everything that `register` added."""
    global _cli_command
    import bpy

    from .operators import registration as operators
    from .rosy_addon.core import cache
    from .rosy_addon.gpu import device
    from .rosy_addon.scene import staleness
    from .rosy_addon.ui import registration as ui

    bpy.utils.unregister_cli_command(_cli_command)
    _cli_command = None
    operators.unregister()
    ui.unregister()
    cache.BAKE_CACHE.clear()
    staleness.SCENE_STATES.clear()
    device.release()
