"""Constants: methods, friction laws, modes, phases of an instance, status codes, rounding errors."""

EXACT = 1  # solver.method without steps; each other method defines its NUMBER in its own file
HYBRID, SIGN, THRESHOLD = 1, 2, 3  # values of the parameter friction
BACKWARD, STUCK, FORWARD = -1, 0, 1  # modes of a contact: direction of sliding, 0 while it sticks

INSTANTIATED, INITIALISING, RUNNING, TERMINATED = 0, 1, 2, 3  # phases of an instance
EVENT, CONTINUOUS, INTERMEDIATE = 4, 5, 6  # phases in which the importer handles events
NO_VALUE = -2147483648  # of an integer without a result: a mode after a failure; it reads NaN as a Real
CO_SIMULATION, MODEL_EXCHANGE = 1, 2  # interface that the importer uses

# Status codes: of the solver; of a run that has already failed; of the calls of an importer
OK, DIVERGED, STALLED, TOO_MANY_STEPS = 0, 1, 2, 3
FAILED = 4
BAD_STEP, BAD_START, BAD_STOP, BAD_VALUE = 5, 6, 7, 8
CALCULATED, FIXED, OUT_OF_RANGE = 10, 11, 12  # reasons for rejecting a value
UNKNOWN_REFERENCE, INVALID_STATE, INTERRUPTED = 13, 14, 15
OUT_OF_ORDER, NULL_POINTER, NO_MEMORY, NOT_SUPPORTED = 16, 17, 18, 19
BUFFER_TOO_SMALL, WRONG_TOKEN, WRONG_LENGTH = 20, 21, 22
NO_PARTIAL_DERIVATIVE, NO_OUTPUT_DERIVATIVE, NO_INPUT_DERIVATIVE = 23, 24, 25
CHATTERING = 26  # of a condition
NEEDS_REPETITION = 27  # of an internal step
MAX_INPUT_ORDER = 3  # highest derivative of an input, of the chain of position, speed, acceleration and jerk
# Rules that the values violate; a model has their messages by status
FIRST_RULE = 101
HYBRID_LAW_ONLY, NO_CONSISTENT_MODES = 101, 102  # method exact with another law; no stick and slip balances the forces
MODEL_RULE = 110  # first rule of the model itself, then its others and its limits

EPSILON = 2.220446049250313e-16  # machine epsilon of a double
ROUNDOFF_MARGIN = 64.0 * EPSILON  # relative tolerance for ties between stick and slip in closed forms
