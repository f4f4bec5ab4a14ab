"""The user interface: properties, panels of the sidebar, preferences, overlay and live views."""
