"""Measured heads: files, directions between those measured, and what scenes sound like by them."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from sound.heads.directions import DirectionMesh
from sound.heads.measured_head import head_of_responses, read_head
from sound.heads.sofa_file import (
    MYSOFA_CHUNK,
    MYSOFA_CHUNKS,
    MYSOFA_TEXT,
    MeasuredResponses,
    read_sofa,
    write_sofa,
)
from sound.radiation.air import SOUND_SPEED
from sound.scenes.audible.hearing import HEAD_RADIUS, Head, heard
from sound.scenes.audible.measured_hearing import filtered, heard_measured
from sound.scenes.performance import Motion
from sound.scenes.playing.play import perform
from sound.scenes.scene_file import load_scene, scene_of
from tests.programs import run
from tests.scenes import ball, require_engine
from tests.synthetic_heads import (
    RATE,
    Anatomy,
    decibels_of,
    delays_of,
    made_head,
    sphere_directions,
    write_head,
)

KEMAR = Path("/usr/share/libmysofa/MIT_KEMAR_normal_pinna.sofa")
"""Head that Debian's package libmysofa1 brings."""
OF_NETCDF = {"CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST"}
"""Attributes by which netCDF tells what dimensions are."""
DIRECTIONS = sphere_directions()
USUAL = Anatomy()
HEAD = head_of_responses(made_head(USUAL, DIRECTIONS), RATE)
EDGE = np.sin(np.radians(-40.0))
"""Height of the lowest measured directions."""


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    return write_head(tmp_path_factory.mktemp("heads") / "made.sofa", USUAL, DIRECTIONS)


@pytest.fixture
def sofa(written, tmp_path) -> Path:
    return Path(shutil.copy(written, tmp_path))


def spread_directions(count: int) -> np.ndarray:
    directions = np.random.default_rng(0).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def still(place: np.ndarray, seconds: float = 1.0) -> Motion:
    times = np.arange(0.0, seconds, 0.01)
    places = np.tile(place, (len(times), 1, 1))
    return Motion(times, places, np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1)))


def ahead() -> Head:
    """A head at the origin whose nose points along x."""
    return Head(np.zeros(1), np.zeros((1, 3)), np.array([1000.0, 0.0, 0.0]))


def click(count: int = RATE // 4) -> np.ndarray:
    source = np.zeros(count)
    source[100] = 1.0
    return source


def levels(sound: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    spectrum = np.abs(np.fft.rfft(sound, axis=0))
    at = np.round(frequencies * len(sound) / RATE).astype(int)
    return 20.0 * np.log10(spectrum[at])


# Files


def test_a_head_is_read_as_it_was_written(sofa):
    expected = made_head(USUAL, DIRECTIONS, "made")
    responses = read_sofa(sofa)
    assert responses.title == "made" and responses.rate == RATE
    np.testing.assert_allclose(responses.directions, DIRECTIONS, atol=1e-12)
    np.testing.assert_allclose(responses.distances, 1.4)
    np.testing.assert_array_equal(responses.responses, expected.responses)


def test_spherical_positions_delays_and_a_turned_listener_are_understood(sofa):
    plain = read_head(sofa)
    with h5py.File(sofa, "r+") as file:
        x, y, z = file["SourcePosition"][()].T
        radius = np.sqrt(x**2 + y**2 + z**2)
        # The listener looks to the left: what was ahead is at 90 degrees.
        azimuth = np.degrees(np.arctan2(y, x)) + 90.0
        elevation = np.degrees(np.arcsin(z / radius))
        file["SourcePosition"][...] = np.stack([azimuth, elevation, radius], axis=1)
        file["SourcePosition"].attrs["Type"] = np.bytes_("spherical")
        # Azimuth, elevation, radius, also of what is up.
        file["ListenerView"][...] = [[90.0, 0.0, 1.0]]
        file["ListenerView"].attrs["Type"] = np.bytes_("spherical")
        file["ListenerUp"][...] = [[0.0, 90.0, 1.0]]
        file["Data.IR"][:, :, :-20] = file["Data.IR"][:, :, 20:]
        file["Data.Delay"][...] = 20.0
    turned = read_head(sofa)
    np.testing.assert_allclose(turned.directions, plain.directions, atol=1e-9)
    np.testing.assert_allclose(turned.delays, plain.delays, atol=2e-6)  # 1/16 sample


def test_other_programs_read_what_is_written(sofa):
    sofar = pytest.importorskip("sofar", reason="sofar is not installed (pip install sofar)")
    head = sofar.read_sofa(str(sofa), verify=False, verbose=False)
    head.verify()
    np.testing.assert_array_equal(head.Data_IR, read_sofa(sofa).responses)


@pytest.fixture(scope="module")
def long_head(tmp_path_factory) -> Path:
    """A head of more numbers than libmysofa reads of a chunk, with a text longer than it reads."""
    path = tmp_path_factory.mktemp("heads") / "long.sofa"
    count, samples = 1100, 500
    responses = MeasuredResponses(
        "long",
        48_000,
        spread_directions(count),
        np.full(count, 1.2),
        np.random.default_rng(1).normal(size=(count, 2, samples)),
        np.zeros((count, 2)),
    )
    write_sofa(path, responses, "", "\u00e4" * MYSOFA_TEXT)
    return path


@pytest.mark.parametrize("name", ["written", "long_head"])
def test_mysofa2json_reads_what_is_written(name, request):
    program = shutil.which("mysofa2json")
    if program is None:
        pytest.skip("mysofa2json is not installed (apt-get install libmysofa-utils)")
    path = request.getfixturevalue(name)
    checked = run(program, "-c", path)
    assert checked.returncode == 0, checked.stderr
    content = json.loads(run(program, path).stdout)
    expected = read_sofa(path)
    assert content["Attributes"]["SOFAConventions"] == "SimpleFreeFieldHRIR"
    data = content["Variables"]["Data.IR"]
    assert data["DimensionNames"] == ["M", "R", "N"]
    shape = expected.responses.shape
    # It prints seven digits of float32.
    np.testing.assert_allclose(
        np.reshape(data["Values"], shape), expected.responses, rtol=1e-6, atol=1e-7
    )


@pytest.mark.parametrize("name", ["written", "long_head"])
def test_a_head_is_stored_as_readers_of_sofa_without_hdf5_demand(name, request):
    """What libmysofa 1.3 takes of HDF5, and the attributes and dimensions of AES69."""
    with h5py.File(request.getfixturevalue(name)) as file:
        required = {"Conventions", "Version", "SOFAConventions", "SOFAConventionsVersion"}
        required |= {"APIName", "APIVersion", "AuthorContact", "DatabaseName", "DataType"}
        required |= {"DateCreated", "DateModified", "License", "ListenerShortName", "Organization"}
        assert required | {"RoomType", "Title"} <= set(file.attrs)
        for place in (file, *file.values()):
            assert h5py.h5o.get_info(place.id).hdr.version == 2
            texts = [each for each in place.attrs if each not in OF_NETCDF]
            for text in map(place.attrs.get_id, texts):
                kind = text.get_type()
                assert kind.get_strpad() == h5py.h5t.STR_NULLTERM
                assert kind.get_size() <= MYSOFA_TEXT
                assert text.get_space().get_simple_extent_type() != h5py.h5s.SIMPLE
        # Further pieces of headers, of which 19 are read in one file.
        assert sum(h5py.h5o.get_info(each.id).hdr.nchunks - 1 for each in file.values()) < 20
        dimensions = {
            "ListenerPosition": "IC",
            "ListenerView": "IC",
            "ListenerUp": "IC",
            "ReceiverPosition": "RCI",
            "SourcePosition": "MC",
            "EmitterPosition": "ECI",
            "Data.IR": "MRN",
            "Data.SamplingRate": "I",
            "Data.Delay": "MR",
        }
        assert set(file) == set(dimensions) | set("MRNEIC")
        for name, letters in dimensions.items():
            dataset = file[name]
            assert [each[0].name for each in dataset.dims] == [f"/{each}" for each in letters]
            assert dataset.shape == tuple(len(file[each]) for each in letters)
            assert dataset.dtype == np.float64 and dataset.shuffle
            assert dataset.compression == "gzip"
            assert dataset.id.get_num_chunks() <= MYSOFA_CHUNKS
            assert np.prod(dataset.chunks) <= MYSOFA_CHUNK


def faults() -> dict[str, tuple]:
    """What is done to a file, and what is then said."""

    def put(name, value):
        def change(file):
            del file[name]
            file[name] = value

        return change

    def tell(name, value):
        return lambda file: file.attrs.__setitem__(name, np.bytes_(value))

    def spoil(file):
        file["Data.IR"][3, 1, 5] = np.nan

    responses = made_head(USUAL, DIRECTIONS).responses
    flat = np.where([True, True, False], DIRECTIONS, 0.0) + [1e-3, 0.0, 0.0]
    return {
        "another convention": (
            tell("SOFAConventions", "SingleRoomDRIR"),
            "follows the convention 'SingleRoomDRIR', expected SimpleFreeFieldHRIR",
        ),
        "no SOFA": (tell("Conventions", "CF-1.6"), "is HDF5 but not SOFA"),
        "spectra": (tell("DataType", "TF"), "holds data of type 'TF', expected FIR"),
        "one ear": (put("Data.IR", responses[:, :1]), "responses at 1 ears"),
        "not finite": (spoil, "Data.IR holds 1 values that are not finite"),
        "wrong rate": (put("Data.SamplingRate", [0.0]), "a sampling rate of 0 Hz, expected one of"),
        "two rates": (put("Data.SamplingRate", [44_100.0, 48_000.0]), "of 44100, 48000 Hz"),
        "in a plane": (put("SourcePosition", flat), "in one plane alone"),
        "few directions": (
            put("SourcePosition", np.tile(np.eye(3), (len(DIRECTIONS), 1))[: len(DIRECTIONS)]),
            "has 3 directions, expected at least 12",
        ),
        "fewer positions": (put("SourcePosition", DIRECTIONS[:9]), "SourcePosition has shape"),
        "no positions": (lambda file: file.__delitem__("SourcePosition"), "'SourcePosition'"),
        "a link": (put("Data.IR", h5py.SoftLink("/SourcePosition")), "holds a link, 'Data.IR'"),
        "silence": (put("Data.IR", 0.0 * responses), "response of zeros alone"),
    }


@pytest.mark.parametrize("fault", faults())
def test_files_that_are_no_use_are_told_in_one_sentence(fault, sofa):
    change, said = faults()[fault]
    with h5py.File(sofa, "r+") as file:
        change(file)
    with pytest.raises(UserError) as error:
        read_head(sofa)
    assert said in str(error.value) and str(sofa) in str(error.value)
    assert "\n" not in str(error.value)


def test_numbers_are_not_taken_from_another_file(sofa, tmp_path):
    other = tmp_path / "other.sofa"
    other.write_bytes(sofa.read_bytes())
    with h5py.File(sofa, "r+") as file:
        del file["Data.IR"]
        file["Data.IR"] = h5py.ExternalLink(str(other), "/Data.IR")
    with pytest.raises(UserError, match="holds a link, 'Data.IR', expected its numbers here"):
        read_head(sofa)


def test_what_is_no_file_of_a_head_is_told(tmp_path):
    with pytest.raises(UserError, match="no such file, expected a measured head"):
        read_head(tmp_path / "none.sofa")
    (tmp_path / "text.sofa").write_text("no HDF5")
    with pytest.raises(UserError, match="is not readable as SOFA"):
        read_head(tmp_path / "text.sofa")


# Directions


def test_directions_are_mixed_of_the_corners_of_their_triangle():
    directions = spread_directions(3000)
    corners, weights, unmeasured = HEAD.mesh.weights(directions)
    assert weights.min() >= 0.0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    mixed = np.einsum("sk,ski->si", weights, DIRECTIONS[corners])
    mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
    np.testing.assert_allclose(mixed[~unmeasured], directions[~unmeasured], atol=1e-9)
    # The edge of triangles is at most half a ring's spacing above the lowest ring's height.
    assert not unmeasured[directions[:, 2] > EDGE + 0.01].any()
    assert unmeasured[directions[:, 2] < EDGE - 0.01].all()


def test_what_was_not_measured_is_taken_from_the_nearest_edge():
    directions = spread_directions(3000)
    below = directions[directions[:, 2] < EDGE - 0.01]
    corners, weights, _ = HEAD.mesh.weights(below)
    mixed = np.einsum("sk,ski->si", weights, DIRECTIONS[corners])
    mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
    nearest = (below @ DIRECTIONS.T).max(axis=1)
    assert ((mixed * below).sum(axis=1) >= nearest - 1e-9).all()
    # The azimuth stays, but for half of the angle between neighbours on the ring.
    found, expected = (np.arctan2(each[:, 1], each[:, 0]) for each in (mixed, below))
    assert np.abs(np.angle(np.exp(1j * (found - expected)))).max() < 0.12


def test_measured_all_around_leaves_no_gap():
    everywhere = sphere_directions((-90.0, 90.0), 15.0)
    assert DirectionMesh(everywhere).is_closed
    assert not DirectionMesh(everywhere).weights(spread_directions(500))[2].any()


def test_between_two_directions_nothing_is_cancelled():
    """Mixed as they are, responses of two directions lose 20 dB and more where delays differ."""
    between = spread_directions(200)
    between = between[between[:, 2] > EDGE + 0.01]
    corners, weights, _ = HEAD.mesh.weights(between)
    filters = np.einsum("sk,sken->sen", weights, HEAD.filters[corners])
    frequencies = np.array([500.0, 1000.0, 2000.0, 4000.0, 8000.0, 12_000.0])
    at = np.round(frequencies * 4096 / RATE).astype(int)
    spectrum = np.abs(np.fft.rfft(filters, 4096)[:, :, at])
    expected = decibels_of(USUAL, between, frequencies)
    front = decibels_of(USUAL, np.array([[1.0, 0.0, 0.0]]), np.linspace(200.0, 500.0, 50)).mean()
    off = 20.0 * np.log10(spectrum) + front - expected
    # Directions are 10 degrees apart, in which notches move by a third of their width.
    assert np.abs(off).max() < 4.0 and np.sqrt(np.mean(off**2)) < 0.6


def test_delays_are_those_of_the_sphere():
    expected = delays_of(USUAL, DIRECTIONS)
    # A sixteenth of a sample is 1.4 us; magnitudes below 200 Hz and the ends of responses differ.
    assert np.abs(HEAD.delays - expected).max() < 15e-6


def test_another_rate_sounds_the_same():
    frequencies = np.array([300.0, 1000.0, 3000.0, 8000.0])
    other = head_of_responses(made_head(USUAL, DIRECTIONS), 48_000.0)
    found, expected = (
        np.abs(np.exp(-2j * np.pi * np.outer(frequencies, np.arange(n)) / rate) @ each[20, 0])
        for each, rate, n in (
            (other.filters, 48_000.0, other.filters.shape[2]),
            (HEAD.filters, RATE, HEAD.filters.shape[2]),
        )
    )
    np.testing.assert_allclose(20.0 * np.log10(found / expected), 0.0, atol=0.1)
    np.testing.assert_allclose(other.delays, HEAD.delays, atol=5e-6)


# Sound


def test_windows_of_blocks_add_up_to_the_sound():
    sound = np.random.default_rng(0).normal(size=1000)
    corners = np.zeros((9, 3), dtype=np.intp)
    response = np.array([[1.0, -0.5, 0.25]])
    found = filtered(sound, response, corners, np.full((9, 3), 1.0 / 3.0))
    np.testing.assert_allclose(found, np.convolve(sound, response[0])[:1000], atol=1e-12)


@pytest.mark.parametrize("number", [0, 9, 100, 200])
def test_a_source_in_a_measured_direction_is_heard_as_it_was_measured(number):
    place = 2.0 * DIRECTIONS[number]
    sound = heard_measured(click(), still(place), 0, ahead(), HEAD, RATE)
    frequencies = np.array([300.0, 1000.0, 3000.0, 5000.0, 8000.0])
    expected = decibels_of(USUAL, DIRECTIONS[[number]], frequencies)[0].T
    front = decibels_of(USUAL, np.array([[1.0, 0.0, 0.0]]), np.linspace(200.0, 500.0, 50)).mean()
    # A cubic between samples loses up to 1 dB at 8 kHz.
    off = levels(sound, frequencies) + 20.0 * np.log10(2.0) + front - expected
    assert np.abs(off).max() < 1.2


def test_straight_ahead_low_frequencies_are_as_loud_as_by_the_spherical_head():
    motion = still(np.array([1.5, 0.0, 0.0]))
    frequencies = np.arange(100.0, 500.0, 20.0)
    both = [
        levels(each, frequencies).mean()
        for each in (
            heard_measured(click(), motion, 0, ahead(), HEAD, RATE),
            heard(click(), motion, 0, ahead(), RATE),
        )
    ]
    assert both[0] == pytest.approx(both[1], abs=0.3)


@pytest.mark.parametrize(
    ("first", "second"), [([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), ([0.8, 0, 0.6], [0.8, 0, -0.6])]
)
def test_front_and_back_and_above_and_below_sound_differently(first, second):
    bands = np.arange(5000.0, 12_000.0, 100.0)

    def difference(hear, *head):
        sounds = [
            levels(hear(click(), still(np.array(each)), 0, ahead(), *head, RATE), bands)
            for each in (first, second)
        ]
        return np.abs(sounds[0] - sounds[1]).max()

    assert difference(heard) < 0.1
    assert difference(heard_measured, HEAD) > 6.0


def test_what_passes_by_changes_its_pitch_as_before():
    """Doppler's shift does not depend on the head."""
    times = np.arange(0.0, 1.0, 0.002)
    places = np.stack([20.0 * (times - 0.5), np.full(len(times), 1.0), 0.0 * times], axis=1)
    motion = Motion(times, places[:, None], np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1)))
    tone = np.sin(2.0 * np.pi * 440.0 * np.arange(RATE) / RATE)
    found = heard_measured(tone, motion, 0, ahead(), HEAD, RATE)
    expected = heard(tone, motion, 0, ahead(), RATE)
    for begin in (0.1, 0.8):
        part = slice(round(begin * RATE), round((begin + 0.1) * RATE))
        pitches = [
            np.argmax(np.abs(np.fft.rfft(each[part, 0] * np.hanning(4410), 1 << 18)))
            for each in (found, expected)
        ]
        # Delays by measurement and by formula change alike but for microseconds.
        assert pitches[0] == pytest.approx(pitches[1], rel=2e-3)


def test_what_turns_around_the_head_does_not_click():
    times = np.arange(0.0, 1.0, 0.002)
    angle = 2.0 * np.pi * times
    places = np.stack([np.cos(angle), np.sin(angle), 0.0 * times], axis=1)
    motion = Motion(times, places[:, None], np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1)))
    tone = np.sin(2.0 * np.pi * 500.0 * np.arange(RATE) / RATE)
    sound = heard_measured(tone, motion, 0, ahead(), HEAD, RATE)[2000:-2000, 0]
    from scipy.signal import butter, sosfilt

    above = sosfilt(butter(6, 2000.0, "high", fs=RATE, output="sos"), sound)[1000:]
    assert np.abs(above).max() < 1e-3 * np.abs(sound).max()


def test_the_nose_tells_where_ahead_is():
    """A source at the left of a head that looks along y, and nods, is at x < 0."""
    nodding = Head(np.zeros(1), np.zeros((1, 3)), np.array([0.0, 1.0, 0.3]))
    axes = nodding.axes(np.zeros(1))[0]
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes[1], [-1.0, 0.0, 0.0], atol=1e-12)
    assert axes[2, 2] > 0.9
    upwards = Head(np.zeros(1), np.zeros((1, 3)), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(upwards.axes(np.zeros(1))[0, 0], [0.0, 0.0, 1.0], atol=1e-12)
    sound = heard_measured(click(), still(np.array([-1.0, 0.0, 0.0])), 0, nodding, HEAD, RATE)
    onsets = np.argmax(np.abs(sound) > 0.2 * np.abs(sound).max(axis=0), axis=0) / RATE
    woodworth = HEAD_RADIUS / SOUND_SPEED * (np.pi / 2.0 + 1.0)
    assert onsets[1] - onsets[0] == pytest.approx(woodworth, abs=1e-4)


# Scenes


def described(sofa: Path, **listener) -> dict:
    return {
        "objects": [
            ball(position=[0.0, 0.0, 0.05]),
            ball("other", position=[0.1, 0.0, 0.02]),
        ],
        "seconds": 0.15,
        "listener": {
            "position": [0.0, -1.0, 0.2],
            "facing": [0.0, 0.0, 0.2],
            "hrtf": str(sofa),
            **listener,
        },
    }


def test_scenes_are_heard_by_a_measured_head_alike_on_any_number_of_threads(sofa):
    require_engine()
    scene = scene_of(described(sofa), Path())
    first, second = (perform(scene, threads, visible=False, raw=True) for threads in (1, 2))
    assert np.array_equal(first.sound, second.sound)
    spherical = replace(scene, listener=replace(scene.listener, hrtf=None))
    plain = perform(spherical, visible=False, raw=True)
    power, plain_power = ((each.sound**2).sum() for each in (first, plain))
    assert not np.array_equal(first.sound, plain.sound)
    assert abs(10.0 * np.log10(power / plain_power)) < 20.0


def test_directions_that_were_not_measured_are_told_once(sofa, capsys):
    require_engine()
    perform(scene_of(described(sofa), Path()), visible=False)
    assert "was not measured" not in capsys.readouterr().err
    above = described(sofa, position=[0.0, -0.3, 1.0], facing=[0.0, 0.3, 1.0])
    perform(scene_of(above, Path()), visible=False)
    assert capsys.readouterr().err.count("the head 'made' was not measured in 100% of") == 1


def test_the_file_of_a_head_is_relative_to_the_scene(sofa):
    lines = "objects: [{name: ball, radius: 0.01, material: steel}]\nlistener: {hrtf: made.sofa}\n"
    (sofa.parent / "scene.yaml").write_text(lines)
    scene = load_scene(sofa.parent / "scene.yaml")
    assert scene.listener.hrtf == str(sofa) and scene.files == [str(sofa)]


def test_a_head_without_space_is_refused(sofa):
    with pytest.raises(UserError, match="listener.hrtf: a measured head hears directions"):
        scene_of({**described(sofa), "sound": {"space": False}}, Path())


def test_the_delays_of_a_real_head_are_near_to_woodworths():
    if not KEMAR.is_file():
        pytest.skip(f"no {KEMAR}: install libmysofa1")
    head = read_head(KEMAR)
    level = np.abs(head.directions[:, 2]) < 0.01
    lateral = np.arcsin(head.directions[level, 1])
    woodworth = HEAD_RADIUS / SOUND_SPEED * (lateral + np.sin(lateral))
    # The mannequin is no sphere: its ears are behind the middle.
    assert np.abs(head.delays[level, 1] - head.delays[level, 0] - woodworth).max() < 60e-6


def test_an_equalised_head_has_no_level_of_its_own_but_all_its_directions():
    head = HEAD
    colour = np.linspace(0.0, 3.0, head.log_magnitudes.shape[2])
    coloured = replace(head, log_magnitudes=head.log_magnitudes + colour.astype(np.float32))
    plain, found = head.equalised(), coloured.equalised()
    assert found.log_magnitudes == pytest.approx(plain.log_magnitudes, abs=1e-4)
    between = head.log_magnitudes - head.log_magnitudes[:1]
    assert found.log_magnitudes - found.log_magnitudes[:1] == pytest.approx(between, abs=1e-4)
    energies = np.exp(2.0 * plain.log_magnitudes.astype(float)).mean(axis=1)
    level = head.mesh.shares @ energies
    assert level == pytest.approx(np.full(len(level), level[0]), rel=1e-4)
