"""Thresholds of the identification of decays, each with its unit and its reason.

They are in the order of the steps of identification.py.  Numbers of the numerics (orders of series, nodes of
interpolation) are with the code that they belong to, because they decide about accuracy only.
"""

# --- Noise of the samples (samples.py) ---
OUTLIER = 8.0  # times the noise: white noise exceeds it in one of 1e15 samples
MIN_SPIKE = 0.02  # of the range: a smaller spike hides no turning point
MAX_SPIKE_ROUNDS = 40  # each round removes the outermost samples of a run of outliers
MAX_SPIKES = 0.05  # fraction of the samples: with more, they are not outliers
COARSE_STEP = 1.5  # times the noise: a larger step between values comes from a quantiser
FINE_NOISE = 1 / 3  # of a step of the values: noise below it cannot be seen through the quantiser
MIN_NOISE = 1e-13  # relative to the amplitude: no record is more precise than rounding

# --- Smoothed position (samples.py) ---
MIN_REVERSAL = 8.0  # times the noise, in the record itself: no pair of noisy samples differs by as much
MIN_REVERSALS = 4  # of the record itself that give its half period
MIN_SMOOTH_REVERSAL = 18.0  # times the noise in the smoothed record, whose noise is correlated within the window
MIN_RELATIVE_REVERSAL = 1e-6  # of the range: a record without noise has rounding errors
CLEAN = 1e-4  # of the range: a record with less noise needs no smoothing
SPECTRUM_SAMPLES = 65_536  # of the spectrum that suggests half periods
MIN_SAMPLES_PER_PERIOD = 8.0  # of a half period from the spectrum: faster ones are noise
SAME_PERIOD = 0.1  # relative difference below which two half periods are one
SMOOTHING_WINDOW = 0.35  # half periods: a polynomial of degree 4 over it follows a sine to 3e-5 of its amplitude
MAX_SAMPLES_PER_HALF_PERIOD = 200  # more add no precision to a turning point: a denser record is averaged
GAP = 0.8  # of a half period without a sample may hide a turning point
MIN_GAP_SAMPLES = 3.0  # median intervals: a sparse record has no gaps between all of its samples
MIN_SEGMENT = 8  # samples between gaps
MIN_TURNING_POINTS = 3  # two amplitudes and the rest position
MIN_SPACING, MAX_SPACING = 0.65, 1.5  # times the interval before: outside, the motion is lost in noise or disturbed

# --- Free decay within a record (window.py) ---
MIN_SELECTED_TURNS = 7  # turning points: with fewer, a decay cannot be distinguished from other motions
MIN_SWINGS = 4  # of a decay
GROWTH_ERRORS = 8.0  # standard errors by which a swing may exceed the one before: none does by chance
SMALL_GROWTH = 1.02  # ratio of neighbouring swings: the scatter of a disturbed decay
SIGNIFICANT_LOSS = 4.0  # standard errors of the loss of all swings
MIN_STEADY_SWINGS = 6  # of a drive before the decay
STEADY = 0.02  # of the largest swing: scatter of swings that a drive keeps up
STEADY_LOSS = 0.2  # of the loss per swing afterwards: the loss per swing of a decay never rises
LARGE_SWING = 2.0  # rad, amplitude from which on a pendulum swings in no wave
NO_WAVE = 0.05  # of the power of a cycle
MANY_SWINGS = 12  # swings that show whether a motion is regular, grows or is constant
LARGE_PART = 0.5  # of the record: a longer decay needs no other half period
LARGE_FIRST = 3.0  # times the median swing: a decay from such a swing is not one of many
SMALL_PART = 0.25  # of the swings: both halves of a shorter decay must be decays
MAX_NODE_SWINGS = 6  # swings from the end of a decay to the node of a beat
CONSTANT = 0.01  # standard error of the loss below which its absence is a constant amplitude
LONG_REST = 2.4  # half periods before the first swing that are left out
BEFORE_FIRST_TURN = 1.1  # half periods: the release before the first swing
SMALL_BEFORE = 0.2  # of the first swing: smaller motions before it are a rest
LARGE_AFTER = 1.2  # times the last swing: a larger one is another motion
RIVAL = 0.5  # weight of another decay, relative to the selected one

# --- Thinning (samples.py) ---
MAX_DENSE_SAMPLES = 10_000  # a record with fewer samples is fitted as it is
MIN_THINNED_SAMPLES = 5_000  # of a thinned record
MIN_THINNED_PER_PERIOD = 64.0  # samples: their means differ by 1.3e-6 of the amplitude
MAX_BLOCK_SPAN = 1.5  # times the median span of neighbouring blocks: a longer one has a gap

# --- Turning points of the decay (samples.py) ---
ENOUGH_TURNING_POINTS = 6  # a segment before a gap is used if it has as many
MIN_NOISY_RANGE = 12.0  # times the noise: a record with a smaller range is all noise
MIN_HALF_PERIOD = 0.5  # of the median: faster reversals are ringing of the smoothed copy at a release
LATE_RELEASE = 1.2  # half periods before the first turning point: the body was held before
EARLY_RELEASE = 0.9  # half periods before the first turning point: released shortly before
PARTIAL_SWING = 0.25  # of a half cycle: a record that begins farther from a turning point begins within the motion
MIN_EXTRAPOLATED = 2.0  # rad: the start of a pendulum beyond it, near its upper rest, is not extrapolated

# --- Fit of the signal (decay_problem.py) ---
MODEL_ACCURACY = 1e-9  # relative to the motion: truncation error of the series, below which no fit is better
UNREACHED_RESIDUAL = 30.0  # standard errors: residual of a turning point that the motion never reaches
FIT_WINDOWS = (0.08, 0.2, 0.45, 1.0)  # fractions of a record: the fit of one window predicts the phase in the next
FIT_WINDOW_STEPS = 15  # of the fit of a window, which only starts that of the next one
MIN_WINDOW = 5.0  # half periods: shorter windows do not separate the losses
MAX_COARSE_SAMPLES = 10_000  # a fit starts with a subset of about this size, whose noise does not matter yet
UNEXPLAINED_RATIO = 1.3  # times the noise: larger residuals call for a fit by growing windows
CONVERGED_GAIN = 1e-2  # variances of a sample: a fit whose next step gains less has converged to a tenth of an error
CONVERGED_CHANGE = 1e-14  # relative, of the values: records without noise converge to rounding
ABSENT_LOSS = 1e-2  # standard errors: a loss that the fit pushes to zero and that is smaller is zero
MAX_FREQUENCY_CHANGE = 10.0  # factor from the start of a fit or the half period: beyond, a step has lost the cycles
MAX_PHASE_CHANGE = 6.3  # rad, a cycle, from the start of a fit: a step beyond it has lost the cycles as well
MAX_DAMPING_RATIO = 0.9  # beyond, nothing oscillates

# --- Free motion (free_motion.py) ---
CERTAIN_TIME = 0.6  # half periods after the last turning point: the motion certainly goes on as long
MIN_QUANTISER_STEPS = 2.0  # between the turning points of a half cycle: with fewer, a record repeats one value
BETTER_START = 0.5  # of the mean square of the residuals: a start is left out only if that halves it at least
MAX_OUTLIERS = 0.001  # fraction of the samples, in addition to two: a record with more does not follow the law
DISTURBANCE_RATIO = 2.0  # times the noise: residuals of a record, or of its first half cycle, that depart from the law
UNDISTURBED_PARTS = (0.8, 0.6, 0.35)  # fractions of the turning points that are tried as undisturbed
MIN_UNDISTURBED = 6  # turning points before a disturbance, to know the law that it departs from
MAX_EXTENSIONS = 6  # of the samples before a disturbance: each fit is valid a little farther than its samples
DEPARTURE_RATIO = 4.0  # times the noise: residual of a half cycle that departs from the law
BETTER_PART = 1.4  # ratio of the residuals of the whole record to those of an undisturbed part that are noise
BETTER_ROUGH_PART = 4.0  # the same if the part departs from the law as well
DEPARTURE_SHARE = 0.05  # fraction of departed samples in the half cycle before it, from which on it departs as well

# --- Selection of the law (model_selection.py) ---
MAX_REFITS = 2  # passes over all pairs of laws: each improves the fits of the one before
EQUAL_DEVIANCE = 1.0  # of n ln(squares): no value of two such laws differs by more than a standard error

# --- Intervals (intervals.py) ---
BLOCKS_PER_HALF_CYCLE = (1.0, 0.3, 0.1, 0.03)  # lengths on which residuals may be correlated
MIN_BLOCKS, MAX_BLOCKS = 24, 400  # fewer leave the variance uncertain; more are shorter than any correlation
INTERVAL_PRECISION = 1e-4  # standard errors: of the ends of an interval, well below what is printed

# --- Test of the residuals (dependences.py) ---
WALK_PIECES = 8  # of the random walk of phase, amplitude and rest position over a record
RANK_RTOL = 1e-9  # of the largest eigenvalue, or singular value: smaller parts are those that the fitted values follow
MIN_GAIN = 3.0  # of the logarithm of the likelihood, odds of 20 to 1: white noise exceeds it in one record of 140
RISE_SPEEDS = (0.05, 0.1, 0.2, 0.4)  # of the first peak speed: the rise of friction falls to 1/e there
MIN_SPEED_HALF_CYCLES = 8  # with fewer, the laws with three losses follow every rise
MIN_SENSITIVITY = 1e-3  # of an amplitude to the first one

# --- Remarks and refusals (remarks.py) ---
ROUGH = 1.5  # times the noise: larger residuals are not the noise of single samples
NOT_A_DECAY = 0.1  # fraction of the motion: with larger residuals the record is refused
NOT_NOISE = 2.0  # times the noise: smaller residuals are no reason to refuse a record
UNRELIABLE = 0.05  # fraction of the motion: with larger residuals that are no noise, no interval is stated
NOISELESS = 3e-4  # of the amplitude: records with less noise are often simulated
EXACT = 1e-9  # of the amplitude: smaller residuals are those of the model, and need no remark
CLEAR_BIC = 6.0  # difference of BIC: odds of 20 to 1
SIMILAR = 1e-3  # of the motion, between two laws: few sensors are as linear
SIGNIFICANT_DEVIANCE = 4.0  # of n ln(squares): an unnecessary term exceeds it in one record of twenty
SIGNIFICANT_GAIN = 5.0  # standard errors of the losses from the nearest ones that are not negative
NEGATIVE = 2.0  # standard errors from losses that are not negative: white noise exceeds it in one record of 30
MIN_ROUNDED = 6  # turning points for a test of their positions between quantiser steps
RAYLEIGH_LIMIT = 12.0  # of n R^2, R the mean of n positions on a circle: exceeded in one record of a hundred thousand
