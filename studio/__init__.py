"""The interactive page and its server: pick a point, drop a clip, hear the solid change."""

import carillon
