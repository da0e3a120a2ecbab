"""Films show and sound what a performance says, at the same time in both streams."""

import sys
from fractions import Fraction
from functools import lru_cache

import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_dilation

from carillon.errors import UserError
from sound.scenes.film.film import FORMATS, write_film
from sound.scenes.film.frames import Stage
from sound.scenes.film.rays import PlacedSurface, RayedSurface, corner_normals
from sound.scenes.performance import Appearance, Camera, Motion, Performance, Picture
from tests.disks import KIB, disk_on

SIZE = (160, 90)
RATE = 44_100
FRAMES_PER_SECOND = 30
SECONDS = 1.01
RADIUS = 0.06
IMPACT_SECONDS = 0.4321
BOUNCE_SPEED = 3.0
GRAVITY = 9.81
CAMERA = Camera((0.0, -2.0, 0.5), (0.0, 0.0, 0.4))
ORANGE = (0.9, 0.5, 0.1)


def ball(radius: float = RADIUS) -> Appearance:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return Appearance("ball", np.array(mesh.vertices), np.array(mesh.faces), ORANGE)


def still(*objects: Appearance, at: list[tuple[float, float, float]], ground: float | None = 0.0):
    """A picture in which nothing moves."""
    unturned = np.tile([1.0, 0.0, 0.0, 0.0], (2, len(objects), 1))
    motion = Motion(np.array([0.0, 1.0]), np.array([at, at]), unturned)
    return Picture(list(objects), motion, ground, CAMERA)


@pytest.fixture(scope="module")
def bouncing() -> Performance:
    """A ball that falls, hits the ground between two frames, and flies up; a click when it hits."""
    times = np.linspace(0.0, SECONDS, 2021)
    after = times - IMPACT_SECONDS
    falling = 0.5 * GRAVITY * (IMPACT_SECONDS**2 - times**2)
    heights = np.where(after < 0.0, falling, BOUNCE_SPEED * after - 0.5 * GRAVITY * after**2)
    positions = np.zeros((len(times), 1, 3))
    positions[:, 0, 2] = RADIUS + heights
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1))
    picture = Picture([ball()], Motion(times, positions, rotations), 0.0, CAMERA)
    sound = np.zeros((round(SECONDS * RATE), 2))
    begin = round(IMPACT_SECONDS * RATE)
    ringing = np.arange(len(sound) - begin) / RATE
    sound[begin:] = 0.5 * (np.exp(-20.0 * ringing) * np.cos(9000.0 * ringing))[:, None]
    return Performance("bounce", picture, sound, RATE, [], [None])


@pytest.fixture(scope="module", params=sorted(FORMATS))
def film(request, bouncing, tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / f"bounce{request.param}"
    write_film(path, bouncing, FRAMES_PER_SECOND, SIZE)
    return path


def pictures(path):
    """Times (n,) [s] and frames (n, H, W, 3) of a film."""
    import av

    with av.open(str(path)) as container:
        frames = [
            (frame.time, frame.to_ndarray(format="rgb24")) for frame in container.decode(video=0)
        ]
    return np.array([time for time, _ in frames]), np.stack([pixels for _, pixels in frames])


def heard(path):
    """Time of the first sample [s], samples (n, 2), and samples per second of a film."""
    import av

    with av.open(str(path)) as container:
        frames = list(container.decode(audio=0))
    sound = np.concatenate([frame.to_ndarray() for frame in frames], axis=1).T
    return frames[0].time, sound, frames[0].sample_rate


def is_orange(pixels):
    """Where (..., H, W) the ball is seen: red is far above blue."""
    return pixels[..., 0].astype(int) - pixels[..., 2] > 60


def test_the_impact_is_seen_and_heard_at_the_same_time(film):
    times, frames = pictures(film)
    rows = is_orange(frames).any(axis=2)
    seen = times[np.array([np.flatnonzero(each).max(initial=-1) for each in rows]).argmax()]
    begin, sound, rate = heard(film)
    onset = begin + np.argmax(np.abs(sound[:, 0]) > 0.25) / rate
    frame = 1.0 / FRAMES_PER_SECOND
    assert abs(seen - IMPACT_SECONDS) <= frame
    assert abs(seen - onset) <= frame
    # A millisecond: what was asked for is a frame, but encoders' delays are told exactly.
    assert onset == pytest.approx(IMPACT_SECONDS, abs=1e-3)


def test_frames_show_their_own_time(film, bouncing):
    times, frames = pictures(film)
    # Matroska, of which WebM is a part, counts milliseconds.
    assert np.abs(times - np.arange(len(times)) / FRAMES_PER_SECOND).max() <= 0.5e-3
    stage = Stage(bouncing.picture, SIZE)
    for number in (0, 7, 20, len(times) - 1):
        shown = is_orange(stage.frame(number / FRAMES_PER_SECOND))
        # Compression blurs the rim of the ball, where colours have half the resolution.
        assert (shown & is_orange(frames[number])).sum() >= 0.7 * shown.sum() > 10


def test_pictures_and_sound_end_together(film, bouncing):
    times, _ = pictures(film)
    begin, sound, rate = heard(film)
    length = len(bouncing.sound) / RATE
    frame = 1.0 / FRAMES_PER_SECOND
    assert begin == 0.0
    assert length <= times[-1] + frame < length + frame
    # What is longer is silence that fills the codec's last block.
    assert length - 1.0 / rate <= len(sound) / rate < length + 0.03


def test_a_film_has_the_same_bytes_again(film, bouncing, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    again = tmp_path / f"again{film.suffix}"
    write_film(again, bouncing, FRAMES_PER_SECOND, SIZE)
    assert again.read_bytes() == film.read_bytes()


@pytest.mark.nightly
def test_a_film_has_the_same_bytes_whatever_memory_held_before(
    film, bouncing, tmp_path, monkeypatch
):
    """Of films that depend on it, one in some thirty differs."""
    paint = lru_cache(None)(Stage(bouncing.picture, SIZE).frame)

    def painted(stage, seconds):
        for size in random.integers(1_000, 200_000, 3):
            random.bytes(size)
        return paint(seconds)

    random = np.random.default_rng(0)
    monkeypatch.setattr(Stage, "frame", painted)
    again, expected = tmp_path / f"again{film.suffix}", film.read_bytes()
    for _ in range(40):
        write_film(again, bouncing, FRAMES_PER_SECOND, SIZE)
        assert again.read_bytes() == expected


def test_a_film_says_what_is_in_it(film):
    import av

    codecs = {".mp4": ("h264", "aac"), ".webm": ("vp9", "opus")}
    with av.open(str(film)) as container:
        video, audio = container.streams.video[0], container.streams.audio[0]
        found = video.codec_context.name, audio.codec_context.name
        assert found == codecs[film.suffix]
        assert (video.width, video.height, video.pix_fmt) == (*SIZE, "yuv420p")
        assert video.average_rate == Fraction(FRAMES_PER_SECOND)
        assert video.codec_context.colorspace == 1  # BT.709
        assert audio.layout.name == "stereo"
        assert container.metadata["title"] == "bounce"


def test_a_ball_is_as_large_as_perspective_has_it():
    stage = Stage(still(ball(0.3), at=[(0.0, 0.0, 0.4)], ground=None), SIZE)
    distance = np.linalg.norm(np.subtract(CAMERA.position, CAMERA.target))
    radius = stage.view.focus * np.tan(np.arcsin(0.3 / distance))
    # The rim is mixed with what is behind it: half a pixel of the radius is allowed.
    area = is_orange(stage.frame(0.0)).sum()
    assert np.pi * (radius - 0.5) ** 2 <= area <= np.pi * (radius + 0.5) ** 2


def ball_and_shadow(height: float, ground: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Where (H, W) a ball is seen, and where it darkens what is behind it."""
    there, away = (
        Stage(still(ball(0.1), at=[(0.0, y, height)], ground=ground), SIZE).frame(0.0).astype(int)
        for y in (0.0, -9.0)
    )
    own = is_orange(there)
    return own, ~binary_dilation(own, iterations=2) & ((away - there).min(axis=2) > 12)


def test_solids_throw_shadows_on_the_ground_and_nowhere_without_it():
    assert ball_and_shadow(0.4, ground=0.0)[1].sum() > 10
    assert not ball_and_shadow(0.4, ground=None)[1].any()


def test_a_shadow_is_nearer_the_lower_a_solid_is():
    def gap(height: float) -> float:
        middles = [np.argwhere(each).mean(axis=0) for each in ball_and_shadow(height, ground=0.0)]
        return float(np.linalg.norm(middles[1] - middles[0]))

    assert gap(0.1) < gap(0.2) < gap(0.4)


def test_the_ground_hides_what_is_below_it():
    assert not is_orange(Stage(still(ball(), at=[(0.0, 0.5, -0.1)]), SIZE).frame(0.0)).any()


def test_nearer_solids_hide_those_behind_them():
    blue = Appearance("blue", 2.0 * ball().vertices, ball().faces, (0.1, 0.2, 0.9))
    for places in ([(0.0, 0.0, 0.4), (0.0, -0.5, 0.425)], [(0.0, 0.0, 0.4), (0.0, 0.5, 0.375)]):
        seen = is_orange(Stage(still(ball(), blue, at=places, ground=None), SIZE).frame(0.0))
        assert seen.any() == (places[1][1] > 0.0)


def test_a_solid_beside_the_camera_is_no_obstacle():
    frame = Stage(still(ball(), ball(0.3), at=[(0.0, 0.0, 0.4), (0.4, -2.0, 0.5)]), SIZE).frame(0.0)
    assert is_orange(frame)[SIZE[1] // 2, SIZE[0] // 2]


def test_looking_straight_down_has_a_picture():
    picture = still(ball(), at=[(0.0, 0.0, 0.3)])
    above = Picture(picture.objects, picture.motion, 0.0, Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0)))
    assert is_orange(Stage(above, SIZE).frame(0.0))[SIZE[1] // 2, SIZE[0] // 2]


def test_normals_are_smooth_on_a_ball_and_broken_at_the_edges_of_a_box():
    sphere = ball(1.0)
    smooth = corner_normals(sphere.vertices, sphere.faces)
    # Those of the triangles are up to 0.09 off, as their corners are 0.16 apart.
    assert np.einsum("fci,fci->fc", smooth, sphere.vertices[sphere.faces]).min() > np.cos(0.02)
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    broken = corner_normals(np.array(box.vertices), np.array(box.faces))
    assert broken == pytest.approx(np.repeat(box.face_normals[:, None], 3, axis=1))


@pytest.mark.parametrize("start, normal", [(-2.0, -1.0), (0.0, -1.0), (2.0, 1.0)])
def test_rays_meet_a_turned_box_where_it_is(start, normal):
    box = trimesh.creation.box((0.4, 1.0, 1.0))
    surface = RayedSurface(np.array(box.vertices), np.array(box.faces))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], np.float32)
    placed = PlacedSurface(surface, np.array([0.0, 0.1, 0.0], np.float32), quarter)
    towards = 1.0 if start <= 0.0 else -1.0
    rays = np.array([[0.0, towards, 0.0], [1e-3, 0.0, 9.0]], np.float32)
    met = placed.meet(np.array([0.0, start, 0.1], np.float32), rays[:1])
    end = 0.1 + (0.2 if start >= 0.0 else -0.2)
    assert met.rays.tolist() == [0]
    assert met.ways[0] == pytest.approx(abs(end - start), abs=1e-6)
    assert met.normals[0] == pytest.approx([0.0, normal, 0.0], abs=1e-6)


def test_films_have_known_endings(bouncing, tmp_path):
    with pytest.raises(UserError, match=r"ends in \.avi, expected a name that ends in \.mp4 or"):
        write_film(tmp_path / "a.avi", bouncing)


@pytest.mark.parametrize(
    "rate, size, said",
    [
        (30, (161, 90), "161 x 90 pixels, expected even numbers"),
        (30, (160, 0), "160 x 0 pixels"),
        (0, SIZE, "0 frames per second, expected 1 or more"),
    ],
)
def test_films_have_sizes_that_codecs_take(bouncing, tmp_path, rate, size, said):
    with pytest.raises(UserError, match=said):
        write_film(tmp_path / "a.mp4", bouncing, rate, size)


@pytest.mark.parametrize("package", ["av", "embreex.rtcore_scene"])
def test_a_missing_package_is_told_with_how_to_install_it(bouncing, tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UserError, match=r"pip install -r workflow/envs/requirements-scenes\.txt"):
        write_film(tmp_path / "a.mp4", bouncing, FRAMES_PER_SECOND, SIZE)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", sorted(FORMATS))
def test_a_film_that_finds_no_room_is_not_there(bouncing, tmp_path, ending):
    with disk_on(tmp_path, 4 * KIB):
        with pytest.raises(UserError, match="could not be written .No space left on device; make"):
            write_film(tmp_path / f"a{ending}", bouncing, FRAMES_PER_SECOND, SIZE)
        assert not list(tmp_path.iterdir())
