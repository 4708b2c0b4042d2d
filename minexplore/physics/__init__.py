"""The robot and its physics in local models of the mine."""
