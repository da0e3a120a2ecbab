"""What scenes sound like, beside the sound of single strikes, theory, and themselves."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import hilbert, welch

from carillon.errors import UserError
from sound.export.scene_gltf import write_scene_gltf
from sound.levels import HEARD
from sound.project.design_file import write_design
from sound.radiation.air import SOUND_SPEED
from sound.rendering.render import Hit, render
from sound.scenes.audible.contact_damping import dashpot
from sound.scenes.audible.hearing import HEAD_RADIUS, Head, heard
from sound.scenes.audible.rough_contact import relative_force, trace
from sound.scenes.audible.sustained_contact import octave_heights, profile
from sound.scenes.bodies import bodies_of
from sound.scenes.hertz import stiffness
from sound.scenes.performance import Motion
from sound.scenes.playing.play import perform
from sound.synthesis.driven import BLOCK, Gains, ring
from sound.synthesis.sinusoids import Bank
from sound.synthesis.sinusoids import ring as ring_bank
from studio.scene.page import write_scene_page
from tests.scenes import QUIET, ball, require_engine, scene, strikes_alone, struck
from tests.small_design import small_design

RATE = 44_100
BAR = {"name": "bar", "mesh": "builtin:bar", "material": "steel", "resolution": 12, "count": 8}


@pytest.fixture(autouse=True)
def _engine():
    require_engine()


def decibels(found: np.ndarray, expected: np.ndarray) -> float:
    return 20.0 * np.log10(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.fixture
def design(tmp_path) -> str:
    write_design(tmp_path / "design.h5", small_design())
    return str(tmp_path / "design.h5")


def thrown_at(target: dict, **sound) -> object:
    return scene(
        {**target, "friction": 0.0},
        ball(position=[0.03, 0.01, 0.1], velocity=[0.0, 0.0, -1.0], friction=0.0),
        gravity=[0, 0, 0],
        ground=None,
        seconds=0.5,
        sound={**QUIET, **sound},
    )


@pytest.mark.parametrize("is_designed", [True, False])
def test_a_strike_sounds_as_render_has_it(is_designed, design):
    described = thrown_at(
        {"name": "box", "design": design} if is_designed else BAR, noise=is_designed
    )
    bodies, (contact,), _ = struck(described)
    body, impact = bodies[0], contact.impact
    hit = Hit(impact.seconds, contact.places[0, 1] + body.centre, -impact.impulse)
    expected = render(body.solid, [hit], 0.5, RATE, impact.duration, body.listening)
    performance = perform(described, visible=False, raw=True)
    for ear in performance.sound.T:
        assert decibels(ear / performance.scale, expected) < -60.0


def test_modes_ring_as_the_bank_has_them_from_strike_to_strike():
    hertz, dampings = np.array([440.0, 1234.5, 23_000.0]), np.array([3.0, 20.0, 5.0])
    seconds = np.array([0.01, 0.0123456, 0.2])
    amplitudes = np.array([[1.0, 0.5, 1.0], [0.3, 2.0, 0.0], [1.0, 1.0, 1.0]])
    firsts = np.ceil(seconds * RATE).astype(np.int64)
    act = strikes_alone(firsts, firsts - seconds * RATE, np.zeros(3), amplitudes)
    found = ring(hertz, dampings, Gains.constant(np.ones(3)), act, RATE // 2, RATE)
    expected = ring_bank(Bank(hertz, dampings, RATE), list(zip(seconds, amplitudes)), RATE // 2)
    assert decibels(found, expected) < -200.0


def test_what_a_body_lies_on_damps_it_by_as_much_as_is_told():
    count, added = RATE // 4, 40.0
    act = strikes_alone(np.zeros(1, np.int64), np.zeros(1), np.zeros(1), np.ones((1, 1)))
    blocks = np.arange(-(-count // BLOCK))
    damped = replace(act, damped=blocks, dampings=np.full((len(blocks), 1), added))
    found = ring(
        np.array([800.0]), np.array([5.0]), Gains.constant(np.ones(1)), damped, count, RATE
    )
    expected = ring(
        np.array([800.0]), np.array([5.0 + added]), Gains.constant(np.ones(1)), act, count, RATE
    )
    assert decibels(found, expected) < -200.0


def test_a_force_that_lasts_moves_a_mode_as_its_equation_of_motion_says():
    hertz, damping, drive = 300.0, 10.0, 250.0
    count = BLOCK * 400
    seconds = np.arange(count) / RATE
    force = np.sin(2 * np.pi * drive * seconds)
    act = replace(
        strikes_alone(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros((0, 1))),
        blocks=np.arange(400),
        courses=force.reshape(-1, BLOCK),
        pushes=np.ones((400, 1)),
    )
    found = ring(
        np.array([hertz]), np.array([damping]), Gains.constant(np.ones(1)), act, count, RATE
    )
    # x'' + 2 d x' + (w^2 + d^2) x = w f; the steady part, when the rest has decayed.
    omega, pushed = 2 * np.pi * hertz, 2 * np.pi * drive
    expected = omega / abs(omega**2 + damping**2 - pushed**2 + 2j * damping * pushed)
    assert np.abs(hilbert(found)[-8000:-2000]).mean() == pytest.approx(expected, rel=0.01)


def test_the_same_scene_sounds_the_same_on_any_number_of_threads():
    described = scene(
        {**BAR, "position": [0, 0, 0.1], "rotation": [10, 20, 0]},
        ball(position=[0.0, 0.0, 0.25]),
        seconds=0.5,
    )
    first, second, third = (perform(described, threads, False).sound for threads in (1, 2, 3))
    assert np.array_equal(first, second) and np.array_equal(first, third)


def test_sounds_reach_full_scale_and_not_beyond():
    described = scene({**BAR, "position": [0, 0, 0.05]}, seconds=0.3)
    assert np.abs(perform(described, visible=False).sound).max() == pytest.approx(0.99)
    quiet = replace(described, sound=replace(described.sound, full_scale=1e-9))
    assert np.abs(perform(quiet, visible=False).sound).max() == pytest.approx(0.99)
    faint = replace(described, sound=replace(described.sound, full_scale=1e6))
    assert np.abs(perform(faint, visible=False).sound).max() < 0.01
    raw = perform(quiet, visible=False, raw=True)
    assert np.abs(raw.sound).max() > 1.0 and raw.scale == pytest.approx(1e9)
    assert raw.level.fade_seconds == 0.0


def test_what_nobody_hears_is_not_amplified(capsys, tmp_path):
    low = {**BAR, "name": "low", "mesh": "builtin:box", "stands_on": "ground"}
    high = {**low, "name": "high", "stands_on": "low"}
    still = perform(scene(low, high, seconds=0.2), 1, visible=False)
    assert not still.sound.any() and still.scale == 1.0 / HEARD
    assert still.level is not None and still.level.in_words() == "silent"
    said = capsys.readouterr().err
    assert "below the threshold of hearing (2e-05 Pa): the sound is silent; let an obj" in said
    for gains in (each.gains for each in still.voices if each is not None):
        assert np.isfinite(gains).all() and gains.any()
    write_scene_page(tmp_path / "still.html", still)
    write_scene_gltf(tmp_path / "still.glb", still, True)


@pytest.mark.parametrize("decibels_above", [-5.0, -0.1, 0.1, 40.0])
def test_a_sound_is_amplified_to_full_scale_if_it_is_above_the_threshold(decibels_above):
    described = scene({**BAR, "position": [0, 0, 0.05]}, seconds=0.2)
    loud = 1.0 / perform(described, 1, visible=False).scale
    level = decibels_above - 20.0 * np.log10(0.99 * loud / HEARD)
    (entry,) = described.objects
    played = perform(replace(described, objects=(replace(entry, level=level),)), 1, visible=False)
    peak = np.abs(played.sound).max()
    assert peak == pytest.approx(0.99 if decibels_above > 0.0 else 0.0)
    assert 1.0 / played.scale >= HEARD


def test_the_end_of_a_scene_fades_where_it_is_cut_off():
    described = scene({**BAR, "position": [0, 0, 0.05]}, seconds=0.3)
    cut = perform(described, visible=False)
    assert cut.level.fade_seconds == pytest.approx(0.03, abs=1e-3) and cut.level.end_dbfs > -60.0
    assert not cut.sound[-1].any()
    assert cut.level.peak_dbfs == pytest.approx(20.0 * np.log10(0.99), abs=0.01)
    damped = scene({**BAR, "position": [0, 0, 0.05], "damping": [400.0, 0.0]}, seconds=0.5)
    assert perform(damped, visible=False).level.fade_seconds == 0.0


def test_what_lies_on_the_ground_rings_shorter():
    dropped = {**BAR, "position": [0, 0, 0.05], "damping": [1.0, 0.0]}
    sounds = [
        perform(scene(dropped, seconds=1.5, sound={"contact_damping": on}), visible=False).sound
        for on in (True, False)
    ]
    damped, free = (np.linalg.norm(sound[-RATE // 2 :]) / np.linalg.norm(sound) for sound in sounds)
    assert damped < 0.5 * free


def test_a_ball_of_modes_is_no_louder_for_a_level_but_by_its_decibels():
    described = scene({**BAR, "position": [0, 0, 0.05]}, seconds=0.3, sound={"full_scale": 1e3})
    louder = replace(described, objects=(replace(described.objects[0], level=6.0),))
    sounds = [perform(each, visible=False).sound for each in (described, louder)]
    assert np.allclose(sounds[1], 10.0 ** (6.0 / 20.0) * sounds[0])


def test_both_solids_sound_that_strike_each_other():
    first = {**BAR, "name": "first", "position": [0, 0, 0.2], "velocity": [0, 0, -1.0]}
    second = {**BAR, "name": "second", "rotation": [0, 0, 90]}
    given = {"gravity": [0, 0, 0], "ground": None, "seconds": 0.3, "sound": {"full_scale": 1e3}}
    silent = {"level": -120.0}
    both, one, other = (
        perform(scene(*objects, **given), visible=False).sound
        for objects in (
            (first, second),
            (first, {**second, **silent}),
            ({**first, **silent}, second),
        )
    )
    assert np.abs(one).max() > 1e-6 and np.abs(other).max() > 1e-6
    assert decibels(one + other, both) < -80.0


@pytest.mark.parametrize("distance", [1.0, 5.0])
def test_a_source_ahead_is_heard_late_and_faint_by_its_distance_alike_in_both_ears(distance):
    click = np.zeros(RATE // 10)
    click[100] = 1.0
    ears = heard(click, _still([0.0, distance, 0.0]), 0, _head(), RATE)
    assert np.allclose(ears[:, 0], ears[:, 1])
    expected = 100 + RATE * distance / SOUND_SPEED
    assert np.argmax(np.abs(ears[:, 0])) == pytest.approx(expected, abs=2.0)
    tone = np.sin(2 * np.pi * 100.0 * np.arange(RATE) / RATE)
    loud = heard(tone, _still([0.0, distance, 0.0]), 0, _head(), RATE)[RATE // 2 :, 0]
    assert np.abs(loud).max() == pytest.approx(1.0 / distance, rel=0.02)


def test_a_source_on_the_right_is_heard_there_first_and_brighter():
    click = np.zeros(4000)
    click[100] = 1.0
    ears = heard(click, _still([2.0, 0.0, 0.0]), 0, _head(), RATE)
    left, right = (np.flatnonzero(np.abs(ear) > 1e-3 * np.abs(ear).max())[0] for ear in ears.T)
    around = HEAD_RADIUS * (1.0 + np.pi / 2.0) / SOUND_SPEED
    assert (left - right) / RATE == pytest.approx(around, abs=2e-4)
    bright = np.abs(np.fft.rfft(ears, axis=0))[-400:].mean(axis=0)
    assert bright[1] > 3.0 * bright[0]


def test_a_source_that_comes_nearer_sounds_higher():
    times = np.arange(0.0, 1.01, 0.01)
    speed = 20.0
    positions = np.stack([0 * times, 30.0 - speed * times, 0 * times], axis=1)[:, None]
    motion = Motion(times, positions, np.tile([1.0, 0, 0, 0], (len(times), 1, 1)))
    tone = np.sin(2 * np.pi * 1000.0 * np.arange(RATE) / RATE)
    ear = heard(tone, motion, 0, _head(), RATE)[RATE // 4 : 3 * RATE // 4, 0]
    spectrum = np.abs(np.fft.rfft(ear * np.hanning(len(ear)), 16 * len(ear)))
    found = np.argmax(spectrum) * RATE / (16 * len(ear))
    assert found == pytest.approx(1000.0 / (1.0 - speed / SOUND_SPEED), abs=1.0)


def test_a_head_that_walks_away_hears_less_and_less():
    tone = np.sin(2 * np.pi * 200.0 * np.arange(2 * RATE) / RATE)
    head = Head(np.array([0.0, 2.0]), np.array([[0.0, 1.0, 0.0], [0.0, 8.0, 0.0]]), np.zeros(3))
    times = np.arange(0.0, 2.01, 0.01)
    still = np.tile([1.0, 0, 0, 0], (len(times), 1, 1))
    ear = heard(tone, Motion(times, np.zeros((len(times), 1, 3)), still), 0, head, RATE)[:, 0]
    near, far = (np.abs(ear[round(at * RATE) :][: RATE // 10]).max() for at in (0.5, 1.9))
    assert near / far == pytest.approx((1.0 + 3.5 * 1.9) / (1.0 + 3.5 * 0.5), rel=0.1)


def test_a_profile_is_as_rough_as_told_and_the_same_for_the_same_seed():
    way = np.arange(0.0, 20.0, 2e-6)
    none = np.zeros(len(way))
    found = profile(way, none, none, 3e-6, 5, RATE)
    assert np.sqrt((found**2).mean()) == pytest.approx(3e-6, rel=0.05)
    assert np.array_equal(found, profile(way, none, none, 3e-6, 5, RATE))
    assert not np.array_equal(found, profile(way, none, none, 3e-6, 6, RATE))
    assert np.abs(profile(way, none, none + 1.0, 3e-6, 5, RATE)).max() < 1e-4 * 3e-6
    assert np.linalg.norm(octave_heights(3e-6)) == pytest.approx(3e-6)


def test_what_slides_is_heard_and_what_lies_still_is_not():
    slid = {**BAR, "name": "slid", "friction": 0.1, "velocity": [2.0, 0, 0]}
    low = -float(bodies_of(scene(slid, ground=None).objects)[0].shape.vertices[:, 2].min())
    described = scene({**slid, "position": [0, 0, low + 1e-5]}, seconds=0.5, gravity=[0, 0, -9.81])
    assert np.abs(perform(described, visible=False).sound[RATE // 10 : RATE // 5]).max() > 1e-4


def test_nothing_that_touches_is_refused():
    with pytest.raises(UserError, match="nothing touches anything within 0.1 s"):
        perform(scene({**BAR, "position": [0, 0, 9.0]}, seconds=0.1), visible=False)


def _still(place) -> Motion:
    return Motion(np.array([0.0, 9.0]), np.array([[place]] * 2), np.tile([1.0, 0, 0, 0], (2, 1, 1)))


def _head() -> Head:
    return Head(np.zeros(1), np.zeros((1, 3)), np.array([0.0, 10.0, 0.0]))


class TestRoughContact:
    """A mass on Hertz's spring that moves over a rough surface."""

    radius, modulus, force, mass = 0.01, 2e10, 1.0, 0.05

    def felt(self, heights):
        """Fluctuation of the force over it, and the resonance of the contact [Hz]."""
        alike = np.full(len(heights), self.force)
        given = self.radius, self.modulus
        dampers = dashpot(alike, *given, self.mass)
        none = np.zeros(len(heights))
        found = relative_force(heights, none, alike, *given, dampers, self.mass, RATE)
        return found, np.sqrt(stiffness(alike, *given)[0] / self.mass) / (2.0 * np.pi)

    @pytest.mark.parametrize("hertz", [50.0, 200.0, 4000.0])
    def test_it_follows_long_waves_and_presses_on_short_ones(self, hertz):
        height = 1e-9 if hertz > 1000.0 else 1e-8
        times = np.arange(RATE) / RATE
        found, resonance = self.felt(height * np.sin(2.0 * np.pi * hertz * times))
        # The linear response of a mass on a spring with a dashpot of the ratio 0.1.
        ratio = hertz / resonance
        contact = float(stiffness(np.array(self.force), self.radius, self.modulus))
        through = (1.0 + 0.2j * ratio) / (1.0 - ratio**2 + 0.2j * ratio)
        wanted = contact * height * ratio**2 * abs(through) / self.force
        late = found[RATE // 2 :]
        assert np.sqrt(2.0 * (late**2).mean()) == pytest.approx(wanted, rel=0.06)

    def test_its_spectrum_rises_to_the_resonance_and_falls_beyond_as_the_roughness(self):
        way = 0.4 * np.arange(8 * RATE) / RATE
        none = np.zeros(len(way))
        found, resonance = self.felt(profile(way, none + 0.4, none, 1e-10, 3, RATE))
        hertz, power = welch(found, RATE, nperseg=4096)

        def level(low, high):
            chosen = (hertz >= low) & (hertz < high)
            return 10.0 * np.log10(power[chosen].mean())

        at = level(0.9 * resonance, 1.1 * resonance)
        # Of a self-affine surface of Hurst exponent 0.8: f^(4 - 2.6) below, f^-2.6 beyond, where
        # the dashpot presses more than the spring; the resonance stands out by 14 dB.
        assert at - level(resonance / 10.0, resonance / 8.0) == pytest.approx(27.0, abs=4.0)
        assert at - level(8.0 * resonance, 10.0 * resonance) == pytest.approx(32.0, abs=4.0)

    def test_bumps_higher_than_its_approach_are_small_impacts_of_the_same_mean_force(self):
        way = 0.4 * np.arange(4 * RATE) / RATE
        none = np.zeros(len(way))
        found, _ = self.felt(profile(way, none + 0.4, none + 1e-4, 5e-6, 3, RATE))
        assert found.min() == -1.0  # it leaves the surface
        assert found.mean() == pytest.approx(0.0, abs=0.02)

    def test_a_round_body_touches_the_highest_points_alone(self):
        rng = np.random.default_rng(0)
        way = np.sort(rng.random(300)) * 1e-2
        way[100:110] = way[100]  # it stands still for a while
        heights = 1e-5 * rng.standard_normal(300)
        lifted = heights - (way[:, None] - way) ** 2 / (2.0 * self.radius)
        assert trace(way, heights, self.radius) == pytest.approx(lifted.max(axis=1), abs=1e-18)


def test_a_round_rod_rolls_without_a_clatter_of_its_facets(tmp_path):
    import trimesh

    path = tmp_path / "rod.obj"
    trimesh.creation.cylinder(0.01, 0.25, sections=48).export(path)
    rod = {"name": "rod", "mesh": str(path), "material": "aluminium", "stands_on": "ground"}
    rolling = {"rotation": [0, 90, 0], "velocity": [0, -0.4, 0], "spin": [40, 0, 0]}
    described = scene({**rod, **rolling, "count": 0}, seconds=0.5)
    bodies, impacts, (lasting,) = struck(described)
    assert bodies[0].cylinder is not None and not impacts
    assert np.ptp(lasting.contacts.positions[:, 1]) == pytest.approx(0.2, rel=0.02)
