"""One page of a scene that needs no server: it is seen and heard together, and can be struck."""

from studio.scene.page import write_scene_page
