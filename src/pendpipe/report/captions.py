"""The words of the page: a caption for each figure, and a glossary for students."""

from typing import Final, NamedTuple


class Caption(NamedTuple):
    """Words that go with a figure."""

    title: str
    shows: str
    reading: str


CAPTIONS: Final = {
    "fig03": Caption(
        "Figure 3. The sensor",
        "The sensor's volts against the angle that a caliper set, with the straight line.",
        "The lower panel is data minus line: points that scatter about zero mean a linear sensor;"
        " an arc or an S means that the sensor is nonlinear. Bars are one standard"
        " deviation; that of the slope is shared by all records.",
    ),
    "fig04": Caption(
        "Figure 4. Hysteretic damping, in air",
        "The limiting Q of each record in air against the square of its frequency.",
        "A straight line through the origin shows internal friction of the structure:"
        " viscous damping with a constant coefficient gives Q ∝ f, a curve here. The lower"
        " panel is the relative deviation from the line; the grey band is the line's own"
        " standard deviation.",
    ),
    "fig05": Caption(
        "Figure 5. What water does to the period",
        "By how much buoyancy and the water that swings along (added mass) lengthen the"
        " period in theory, alone and together. Symbols are the records; lines join them.",
        "The scale is logarithmic. In the low branch the weights nearly balance, so a little"
        " buoyancy cancels most of the restoring torque.",
    ),
    "fig06": Caption(
        "Figure 6. The history term",
        "The viscous limit of Q: Stokes' law for steady flow (dashed), Eq. 16 with its history"
        " term 1 + a/δ (solid), and the measured values by Eq. 17 (symbols).",
        "The scale is the decimal logarithm, so 1 is a factor of ten. The arrows say by how much"
        " the history term divides Q in the middle of a branch.",
    ),
    "fig07": Caption(
        "Figure 7. A typical free decay",
        "Every sample of the typical record and the amplitude of the fitted law.",
        "The lower panel is data minus fit: the turning points less that amplitude, with their"
        " standard deviations. A trend there is physics that the model lacks.",
    ),
    "fig08": Caption(
        "Figure 8. Q during the same decay",
        "Q of the fitted law against time. Circles are the logarithmic"
        " decrement between turning points, independent of the model.",
        "Q rises while the quadratic drag (a) decreases, is largest near y = √(c/a), and falls"
        " when the bearing's friction (c) dominates. The dashed line has exponential losses"
        " alone. The band (95 %) may be thinner than the line.",
    ),
    "fig09": Caption(
        "Figure 9. Experiment against theory",
        "The limiting Q of every record in water, with the sum of Eq. 16 and the hysteretic loss of"
        " figure 4. No parameter is adjusted to these points.",
        "Lower panel: measured over theory, at each record's own geometry. A common shortfall"
        " means that the drag is larger than Eq. 16 by the factor printed there; the bands are one"
        " standard deviation of the theory, from all inputs and from the loss torque, which may"
        " differ between air and water. At low frequency the points"
        " are closer to 1 because hysteresis, not water, damps the motion.",
    ),
    "fig10": Caption(
        "Figure 10. Hysteresis left out",
        "The same points with Eq. 16 alone, in red; the full theory in grey.",
        "The shaded gap is the error of ignoring internal friction: large in the low branch,"
        " small in the high one.",
    ),
    "causes": Caption(
        "What each cause predicts",
        "The viscous loss of every record in the fluid above that of Eq. 16, within the walls of"
        " the tank where one is told, inputs as configured (symbols), and what each cause alone"
        " would add if its size were the best for these points (lines, one part for each branch)."
        " Left the causes that all records together cannot distinguish, right those that they"
        " reject.",
        "A cause explains the mismatch only if its line has the sign, the size and the frequency"
        " dependence of the points; the table gives the size that it would need.",
    ),
    "walls": Caption(
        "The tank's walls",
        "What walls, floor and surface of a tank of the told length and width do to the drag of a"
        " sphere half way up in it, against the depth of the fluid, at the median frequency; the"
        " grey band is the drag measured over Eq. 16 (95 %).",
        "Half way up the drag is the least. Where the curves lie above the band at the told depth,"
        " the walls as told would explain more than there is.",
    ),
    "residual_map": Caption(
        "Residual, before and after",
        "Data minus model against time and phase of the cycle, in standard errors of a cell: the"
        " baseline above, with the missing effects below.",
        "Phase 0 is the turning point on the positive side, π that on the negative. Bands along"
        " the time axis at the crossings (π/2, 3π/2) are an error of the phase, at the turning"
        " points an error of the amplitude; vertical stripes are events. The lower panel should"
        " show only noise.",
    ),
    "waveform": Caption(
        "Waveform",
        "Every reading of a record with the amplitude of the fitted law; what was cut is shaded.",
        "Drag over a stretch of time, or press + and −, to zoom in on the readings; 0 shows all.",
    ),
    "quality": Caption(
        "Q against amplitude",
        "Q of the fitted law (line), and of the turning points without a law (circles).",
        "Q falls to the right where drag dominates, and to the left where dry friction does.",
    ),
    "decay": Caption(
        "Decay",
        "Amplitudes of the turning points, with those of the fitted law and, for contrast,"
        " the best fit of linear damping alone.",
        "The upper scale is logarithmic: linear damping is a straight line there. Below: data"
        " minus the fitted law, bars of one standard deviation.",
    ),
}

OF_A_RECORDING: Final = {
    "residual": Caption(
        "The residual of the fitted law",
        "The turning points less the amplitude of the fitted law, bars of one standard deviation.",
        "Points that scatter about zero mean that the law describes the decay; a trend is"
        " physics that it lacks.",
    ),
    "prediction": Caption(
        "What another experiment would show",
        "The next decay, and amplitude and phase when it is driven, with bands that hold 95 %;"
        " measured points where a table was given.",
        "Dashed states are unstable. Grey lies beyond the amplitudes of the decay: there the"
        " prediction extrapolates. Red points lie outside of their bands.",
    ),
    "residual_map": CAPTIONS["residual_map"],
    "residual_spectrum": Caption(
        "Spectrum of the residual",
        "Residuals of both models against frequency, with noise and harmonics of the motion.",
        "A peak at a harmonic is a nonlinear torque or sensor; a peak between harmonics is"
        " another vibration or a hum; a residual at the level of the noise is explained.",
    ),
    "damping": Caption(
        "Loss against amplitude",
        "Relative loss of amplitude of a few cycles at a time, of the readings and of both models.",
        "Points on one side of a line mean that the loss follows another law: an upward slope is"
        " drag, a rise towards small amplitudes dry friction.",
    ),
    "frequency": Caption(
        "Frequency against amplitude",
        "Frequency of a few cycles at a time, of the readings and of both models.",
        "sin x lowers it with the square of the amplitude. Points off the line at small amplitudes"
        " suggest a stiffer bearing, points off at random the clock.",
    ),
    "decay": Caption(
        "The end of the decay, with both models",
        "Amplitude of each cycle, and the residuals of the baseline and the extended model.",
        "The difference of the two residuals is the missing effect.",
    ),
    "curve": Caption(
        "The missing force",
        "The curve that may stand in the place of what is missing, with its 95 % band; over it,"
        " what has a name.",
        "Something acts where it differs from zero. A name whose line leaves the band is not all.",
    ),
}
"""Words for the figures of one recording's page."""

EQUATIONS: Final = (
    (
        "Eq. 8",
        r"\ddot x + \left[\frac{\pi\omega^2 y_0}{4Q_{c0}} + \frac{\pi\omega}{4Q_h}\rho"
        r" + \frac{\pi}{4y_0Q_{f0}}\rho^2\right]\mathrm{sgn}(\dot x) + \frac{\omega}{Q_v}\dot x"
        r" + \omega^2 x = 0, \quad \rho^2 = \omega^2x^2 + \dot x^2",
        "The law of motion. Where a record swings by sin x, ω² sin x stands for ω² x, and"
        " 2ω²(1 − cos x) for ω²x² in ρ².",
    ),
    ("Eq. 13", r"-\frac{dy}{dt} = a y^2 + b y + c", "The loss of its amplitude y, to first order."),
    ("Eq. 15", r"Q(y) = \frac{\pi f}{a y + b + c/y}", "The quality factor at an amplitude."),
    (
        "Eq. 16",
        r"Q_v = \frac{I\omega}{6\pi\eta R\,(1 + R/\delta)\,L^2}, \quad"
        r" \delta = \sqrt{\frac{2\eta}{\omega\rho}}",
        "That of a sphere of radius R at the distance L from the axis in a fluid.",
    ),
    (
        "Eq. 17",
        r"\frac{1}{Q_v} = \frac{1}{Q} - \frac{1}{Q_h}, \quad Q_h = k f^2",
        "The viscous part of a limiting Q.",
    ),
)
"""What the page refers to by number, as LaTeX."""

GLOSSARY: Final = (
    ("Free decay", "The motion of a pendulum that was released and is left alone."),
    (
        "Turning point",
        "Where the pendulum stands still for an instant and turns back; its distance"
        " from the equilibrium is the amplitude y.",
    ),
    (
        "Quality factor Q",
        "2π times the stored energy over the energy lost in a cycle. A pendulum"
        " of Q = 100 loses 6 % of its energy in a cycle.",
    ),
    (
        "a, b, c",
        "The rates of Eq. 13, −dy/dt = a y² + b y + c: drag that grows as the square of"
        " the velocity, exponential losses, and friction that does not depend on the amplitude.",
    ),
    ("Limiting Q", "π f/b, the Q that the exponential losses alone would give (a = c = 0)."),
    (
        "Coulomb friction",
        "Dry friction of constant size, as in a bearing. It stops a pendulum in finite time.",
    ),
    (
        "Hysteretic damping",
        "Internal friction of the structure: the energy lost in a cycle does"
        " not depend on how fast the cycle is. Its Q grows as the square of the frequency.",
    ),
    ("Viscous damping", "Friction proportional to the velocity, in a fluid."),
    (
        "Penetration depth δ",
        "How far an oscillating surface drags the fluid along: √(2η/(ωρ)),"
        " about half a millimetre to two millimetres in water here.",
    ),
    (
        "History term a/δ",
        "What oscillation adds to Stokes' drag on a sphere of radius a, because the"
        " fluid remembers earlier motion.",
    ),
    ("Added mass", "The water that swings with the sphere and adds to its moment of inertia."),
    ("Moment of inertia I", "The resistance to angular acceleration, in kg m²."),
    ("Residual", "Data minus fit, always in this order."),
    (
        "χ² per degree of freedom",
        "The mean square of the residual over that of the noise: 1 if the"
        " model lacks nothing, more if it does.",
    ),
    (
        "Standard deviation (sd)",
        "The ± of a number: in two of three cases the truth lies within"
        " it. 3.84950(74) means 3.84950 ± 0.00074.",
    ),
    (
        "Pull",
        "The found value less the hidden truth, in standard deviations; it should rarely exceed 2.",
    ),
)
