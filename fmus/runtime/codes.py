"""A number for everything that is told apart by one, said here and nowhere else."""

EXACT = 1  # the method without steps, as solver.method; the others say their numbers themselves
HYBRID, SIGN, THRESHOLD = 1, 2, 3  # friction laws, as friction
BACKWARD, STUCK, FORWARD = -1, 0, 1  # modes

INSTANTIATED, INITIALISING, RUNNING, TERMINATED = 0, 1, 2, 3  # phases of an instance
EVENT, CONTINUOUS, INTERMEDIATE = 4, 5, 6  # further ones, where the importer handles events
CO_SIMULATION, MODEL_EXCHANGE = 1, 2  # what an importer has it for

# Statuses: of the motion; of a run that failed before; of what an importer asks for
OK, DIVERGED, STALLED, TOO_MANY_STEPS = 0, 1, 2, 3
FAILED = 4
BAD_STEP, BAD_START, BAD_STOP, BAD_VALUE = 5, 6, 7, 8
CALCULATED, FIXED, OUT_OF_RANGE = 10, 11, 12  # why a value is bad
UNKNOWN_REFERENCE, INVALID_STATE, INTERRUPTED = 13, 14, 15
OUT_OF_ORDER, NULL_POINTER, NO_MEMORY, NOT_SUPPORTED, BUFFER_TOO_SMALL, WRONG_TOKEN, WRONG_LENGTH = (
    16,
    17,
    18,
    19,
    20,
    21,
    22,
)
NO_PARTIAL_DERIVATIVE, NO_OUTPUT_DERIVATIVE, NO_INPUT_DERIVATIVE = 23, 24, 25
MAX_INPUT_ORDER = 8  # order of a derivative of an input: that of dop853, to which one beyond it says nothing
FIRST_RULE = 100  # and the number of the rule of the model that the values break
