/* Every function of FMI 3.0 in every state of every kind of instance, of the sources of a native FMU: this program
 * includes them.
 *
 *     walk states THREADS | calls SEED TURNS     how many lives there were | nothing
 *
 * It ends by abort() where an answer is not the right one, and a sanitizer ends it where memory is.
 */
#include "fmi3.c"

#include <pthread.h>

#include "stress.h"

enum { FEW = 12, BYTES = sizeof(SavedState), CROWD = 20, STRANGER = VARIABLES + 7 };
enum { SOLVING, HANDLING, SOLVED, KINDS }; /* co-simulation; with events, early return and looks; model exchange */

/* An instance, and all that its importer hands to it. */
typedef struct Desk {
    Instance *it;
    int kind, heard;
    void (*look)(struct Desk *desk); /* in an intermediate update */
    const struct Row *row;           /* what it does there */
    bool right;
    fmi3ValueReference one, unknown, known;
    size_t count, states, limits, size;
    double t, h, real, reals[FEW], others[FEW];
    int64_t integers[FEW];
    int32_t orders[FEW];
    bool flags[6], wants;
    fmi3FMUState state;
    fmi3ValueReference references[FEW];
    fmi3Byte bytes[BYTES];
    void *room[FEW]; /* for values of any type */
} Desk;

#define AT ((Desk *)it->host.environment)
#define R AT->references, AT->count
#define ROOM (void *)AT->room

/* ---- the functions: where the standard allows them, the state they lead to, and a call that is right and one that
 * must be refused.  SOME: where it may be allowed or not; OURS: whatever ends an initialisation. */

enum { STAYS = -1, OURS = -2 };
enum { SOME = 1 << PHASES, EXCHANGED = 2 << PHASES, STEPPED = 4 << PHASES, HANDLED = 8 << PHASES };
enum { NEVER = 0, AT_EVENT = 1 << EVENT, GOING = 1 << CONTINUOUS, BEGINNING = 1 << INITIALISING };

#define TRANSITIONS(f)                                                                                                 \
    f(EnterInitializationMode, IN_INSTANTIATED, INITIALISING, (it, true, 1e-5, 0.0, true, 9.0), (NULL, false, 0.0, 0.0, false, 0.0)) \
    f(ExitInitializationMode, BEGINNING, OURS, (it), (NULL))                                                           \
    f(EnterEventMode, (IN_SIMULATION | HANDLED), EVENT, (it), (NULL))                                                          \
    f(UpdateDiscreteStates, AT_EVENT, STAYS,                                                                           \
      (it, AT->flags, AT->flags + 1, AT->flags + 2, AT->flags + 3, AT->flags + 4, &AT->real),                          \
      (it, AT->flags, AT->flags + 1, AT->flags + 2, NULL, AT->flags + 4, &AT->real))                                   \
    f(EvaluateDiscreteStates, (BEGINNING | AT_EVENT), STAYS, (it), (NULL))                                             \
    f(EnterStepMode, (AT_EVENT | STEPPED), RUNNING, (it), (NULL))                                                      \
    f(EnterContinuousTimeMode, (AT_EVENT | EXCHANGED), CONTINUOUS, (it), (NULL))                                       \
    f(DoStep, IN_STEP_MODE, STAYS, (it, AT->t, AT->h, true, AT->flags, AT->flags + 1, AT->flags + 2, &AT->real),           \
      (it, AT->t, AT->h, true, AT->flags, AT->flags + 1, AT->flags + 2, NULL))                                         \
    f(SetTime, (GOING | EXCHANGED | SOME), STAYS, (it, AT->t), (NULL, 0.0))                                            \
    f(SetContinuousStates, GOING, STAYS, (it, AT->reals, AT->states), (it, AT->reals, STATES + 1))                     \
    f(CompletedIntegratorStep, GOING, STAYS, (it, true, AT->flags, AT->flags + 1), (it, true, NULL, AT->flags))        \
    f(Reset, IN_ANY_PHASE, INSTANTIATED, (it), (NULL))                                                                          \
    f(Terminate, IN_SIMULATION, TERMINATED, (it), (NULL))

#define VALUES(f, TYPE)                                                                               \
    f(Get##TYPE, SOME, STAYS, (it, R, ROOM, AT->count), (it, &AT->one, 1, ROOM, 1))           \
    f(Set##TYPE, SOME, STAYS, (it, R, ROOM, AT->count), (it, &AT->one, 1, ROOM, 1))

#define OTHERS(f)                                                                                                      \
    VALUES(f, Float32) VALUES(f, Int8) VALUES(f, UInt8) VALUES(f, Int16) VALUES(f, UInt16) VALUES(f, Int32)            \
    VALUES(f, UInt32) VALUES(f, UInt64) VALUES(f, Boolean) VALUES(f, String)                                           \
    f(GetBinary, SOME, STAYS, (it, R, &AT->size, ROOM, AT->count), (it, &AT->one, 1, &AT->size, ROOM, 1))      \
    f(SetBinary, SOME, STAYS, (it, R, &AT->size, ROOM, AT->count), (it, &AT->one, 1, &AT->size, ROOM, 1))      \
    f(GetClock, SOME, STAYS, (it, R, AT->flags), (it, &AT->one, 1, AT->flags))                                         \
    f(SetClock, SOME, STAYS, (it, R, AT->flags), (it, &AT->one, 1, AT->flags))                                         \
    f(GetFloat64, SOME, STAYS, (it, &AT->known, 1, &AT->real, 1), (it, &AT->known, 1, AT->reals, 2))                   \
    f(GetInt64, SOME, STAYS, (it, R, AT->integers, AT->count), (it, &AT->known, 1, AT->integers, 1))                   \
    f(SetFloat64, SOME, STAYS, (it, &AT->known, 1, &AT->real, 1), (it, &AT->known, 1, NULL, 1))                        \
    f(SetInt64, SOME, STAYS, (it, R, AT->integers, AT->count), (it, NULL, 1, AT->integers, 1))                         \
    f(SetDebugLogging, SOME, STAYS, (it, true, 0, NULL), (it, true, 1, NULL))                                          \
    f(GetContinuousStates, (EXCHANGED | SOME), STAYS, (it, AT->others, AT->states), (it, AT->others, STATES - 1))      \
    f(GetContinuousStateDerivatives, (EXCHANGED | SOME), STAYS, (it, AT->others, AT->states), (it, NULL, STATES))      \
    f(GetNominalsOfContinuousStates, (EXCHANGED | SOME), STAYS,                                                        \
      (it, AT->others, AT->states), (it, AT->others, STATES + 1))                                                      \
    f(GetEventIndicators, (EXCHANGED | SOME), STAYS, (it, AT->others, AT->limits), (it, AT->others, INDICATORS + 1))   \
    f(GetNumberOfContinuousStates, SOME, STAYS, (it, &AT->size), (it, NULL))                                           \
    f(GetNumberOfEventIndicators, SOME, STAYS, (it, &AT->size), (it, NULL))                                            \
    f(GetDirectionalDerivative, SOME, STAYS, (it, &AT->unknown, 1, &AT->known, 1, AT->reals, 1, AT->others, 1),        \
      (it, &AT->unknown, 1, &AT->known, 1, AT->reals, 1, AT->others, 2))                                               \
    f(GetAdjointDerivative, SOME, STAYS, (it, &AT->unknown, 1, &AT->known, 1, AT->reals, 1, AT->others, 1),            \
      (it, &AT->unknown, 1, &AT->known, 1, NULL, 1, AT->others, 1))                                                    \
    f(GetFMUState, IN_ANY_PHASE, STAYS, (it, &AT->state), (it, NULL))                                                           \
    f(SetFMUState, IN_ANY_PHASE, STAYS, (it, AT->state), (it, NULL))                                                            \
    f(SerializedFMUStateSize, IN_ANY_PHASE, STAYS, (it, AT->state, &AT->size), (it, AT->state, NULL))                           \
    f(SerializeFMUState, IN_ANY_PHASE, STAYS, (it, AT->state, AT->bytes, BYTES), (it, AT->state, AT->bytes, BYTES - 1))         \
    f(DeserializeFMUState, IN_ANY_PHASE, STAYS, (it, AT->bytes, BYTES, &AT->state), (it, AT->bytes, BYTES - 1, &AT->state))     \
    f(GetOutputDerivatives, SOME, STAYS, (it, R, AT->orders, AT->reals, AT->count),                                    \
      (it, &AT->one, 1, AT->orders, AT->reals, 1))                                                                     \
    f(FreeFMUState, IN_ANY_PHASE, STAYS, (it, &AT->state), (NULL, NULL))                                                        \
    f(EnterConfigurationMode, NEVER, STAYS, (it), (NULL))                                                              \
    f(ExitConfigurationMode, NEVER, STAYS, (it), (NULL))                                                               \
    f(GetNumberOfVariableDependencies, NEVER, STAYS, (it, AT->known, &AT->size), (it, AT->known, NULL))                \
    f(GetVariableDependencies, NEVER, STAYS, (it, AT->known, NULL, NULL, NULL, NULL, 0),                               \
      (it, AT->one, NULL, NULL, NULL, NULL, 1))                                                                        \
    f(GetIntervalDecimal, NEVER, STAYS, (it, R, AT->reals, ROOM), (it, R, NULL, NULL))                             \
    f(GetIntervalFraction, NEVER, STAYS, (it, R, ROOM, ROOM, ROOM), (it, R, NULL, NULL, NULL))             \
    f(GetShiftDecimal, NEVER, STAYS, (it, R, AT->reals), (it, R, NULL))                                                \
    f(GetShiftFraction, NEVER, STAYS, (it, R, ROOM, ROOM), (it, R, NULL, NULL))                                \
    f(SetIntervalDecimal, NEVER, STAYS, (it, R, AT->reals), (it, R, NULL))                                             \
    f(SetIntervalFraction, NEVER, STAYS, (it, R, ROOM, ROOM), (it, R, NULL, NULL))                             \
    f(SetShiftDecimal, NEVER, STAYS, (it, R, AT->reals), (it, R, NULL))                                                \
    f(SetShiftFraction, NEVER, STAYS, (it, R, ROOM, ROOM), (it, R, NULL, NULL))                                \
    f(ActivateModelPartition, NEVER, STAYS, (it, AT->known, 0.0), (it, AT->one, NAN))

#define DEFINE(name, allowed, to, fine, bad)                             \
    static fmi3Status right_##name(Instance *it) { return fmi3##name fine; } \
    static fmi3Status wrong_##name(Instance *it) { (void)it; return fmi3##name bad; }

TRANSITIONS(DEFINE)
OTHERS(DEFINE)

static const struct Row {
    const char *name;
    int allowed, to;
    fmi3Status (*right)(Instance *it), (*wrong)(Instance *it);
} rows[] = {
#define ENTRY(name, allowed, to, fine, bad) {#name, allowed, to, right_##name, wrong_##name},
    TRANSITIONS(ENTRY) OTHERS(ENTRY)
};

#define COUNT(name, allowed, to, fine, bad) +1
enum { LEADING = 0 TRANSITIONS(COUNT), ROWS = sizeof rows / sizeof *rows };

/* ---- lives */

static void hear(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    Desk *desk = environment;
    HOLDS(status == fmi3Error && !strcmp(category, "logStatusError") && *message);
    desk->heard++;
}

static void look(fmi3InstanceEnvironment environment, fmi3Float64 t, fmi3Boolean set, fmi3Boolean get,
                 fmi3Boolean finished, fmi3Boolean early, fmi3Boolean *wants, fmi3Float64 *wanted)
{
    Desk *desk = environment;
    (void)finished;
    HOLDS(set && get && early && isfinite(t));
    if (desk->look) desk->look(desk);
    *wants = desk->wants, *wanted = desk->h;
}

static Instance *born(Desk *desk, int kind)
{
    bool handles = kind == HANDLING;
    *desk = (Desk){.kind = kind, .one = STRANGER, .states = STATES, .limits = INDICATORS, .h = 0.1};
    for (fmi3ValueReference i = 0; i < VARIABLES; i++) {
        if (variables[i].is_state_or_input) desk->known = i;
        else if (variables[i].tangent_offset != NO_OFFSET && variables[i].is_calculated) desk->unknown = i;
    }
    desk->it = kind == SOLVED ? fmi3InstantiateModelExchange("it", MODEL_GUID, NULL, false, true, desk, hear)
                              : fmi3InstantiateCoSimulation("it", MODEL_GUID, NULL, false, true, handles, handles, NULL,
                                                            0, desk, hear, handles ? look : NULL);
    HOLDS(desk->it);
    return desk->it;
}

/* An instance in a state, with a saved state of it in memory and as bytes; false if its kind knows no such state. */
static bool lives(Desk *desk, int kind, int phase)
{
    Instance *it = born(desk, kind);
    bool begun = phase > INITIALISING, events = phase == EVENT || phase == CONTINUOUS;
    if (phase >= INITIALISING) HOLDS(right_EnterInitializationMode(it) == fmi3OK);
    if (begun) HOLDS(right_ExitInitializationMode(it) == fmi3OK);
    if (begun && kind == HANDLING && phase != EVENT) HOLDS(right_EnterStepMode(it) == fmi3OK);
    if (phase == CONTINUOUS && kind == SOLVED) HOLDS(right_EnterContinuousTimeMode(it) == fmi3OK);
    if (phase == TERMINATED) HOLDS(right_Terminate(it) == fmi3OK);
    HOLDS(fmi3GetFMUState(it, &desk->state) == fmi3OK && right_SerializeFMUState(it) == fmi3OK);
    if (kind == SOLVED) return phase != RUNNING && phase != INTERMEDIATE;
    return kind == HANDLING ? phase != CONTINUOUS : !events && phase != INTERMEDIATE;
}

static void dies(Desk *desk)
{
    if (desk->state) HOLDS(fmi3FreeFMUState(desk->it, &desk->state) == fmi3OK);
    fmi3FreeInstance(desk->it);
}

/* ---- the walk */

/* 1 if a call is allowed, 0 if not, -1 if it may be either. */
static int is_allowed(const struct Row *row, int kind, int phase)
{
    int only = row->allowed;
    if ((only & EXCHANGED && kind != SOLVED) || (only & STEPPED && kind == SOLVED)) return 0;
    if (only & HANDLED && kind == SOLVING) return 0;
    return only >> phase & 1 ? 1 : only & SOME ? -1 : 0;
}

/* The call of the row is answered as it must be: refused ones change nothing, and say one sentence. */
static void call(Desk *desk)
{
    Instance *it = desk->it;
    const struct Row *row = desk->row;
    State before = it->state;
    int phase = before.run.phase, allowed = desk->right ? is_allowed(row, desk->kind, phase) : 0;
    desk->look = NULL;
    desk->heard = 0;
    fmi3Status status = (desk->right ? row->right : row->wrong)(it);
    int to = row->to == OURS ? (it->host.event_mode_used ? EVENT : RUNNING) : row->to == STAYS ? phase : row->to;
    bool good = status == fmi3OK ? allowed && !desk->heard && it->state.run.phase == to
                                 : status == fmi3Error && allowed < 1 && desk->heard <= 1 &&
                                       (desk->heard || !desk->right) && !memcmp(&before, &it->state, sizeof before);
    if (!good) printf("fmi3%s, kind %d, state %d, right %d: status %d\n", row->name, desk->kind, phase, desk->right, status);
    HOLDS(good);
}

static void *walk(void *told)
{
    int *count = told;
    for (int kind = 0; kind < KINDS; kind++) {
        for (int phase = 0; phase < PHASES; phase++) {
            for (int i = 0; i < 2 * ROWS; i++) {
                Desk desk;
                ++*count;
                if (lives(&desk, kind, phase)) {
                    desk.row = &rows[i / 2], desk.right = i % 2;
                    desk.look = call; /* once, in its state */
                    if (phase != INTERMEDIATE) call(&desk);
                    else HOLDS(right_DoStep(desk.it) == fmi3OK && !desk.look);
                }
                dies(&desk);
            }
        }
    }
    return NULL;
}

/* In every thread; the number of lives. */
static int together(int threads)
{
    enum { MOST = 16 };
    pthread_t each[MOST];
    int counts[MOST] = {0}, all = 0;
    HOLDS(threads <= MOST);
    for (int i = 0; i < threads; i++) HOLDS(!pthread_create(&each[i], NULL, walk, &counts[i]));
    for (int i = 0; i < threads; all += counts[i++]) HOLDS(!pthread_join(each[i], NULL));
    return all;
}

/* ---- calls in any order, with anything in them */

static void anything(Desk *desk)
{
    const struct Row *row = &rows[draw(2) ? draw(LEADING) : draw(ROWS)];
    desk->t = draw(4) ? desk->it->state.model.solver.t : number();
    desk->h = draw(4) ? (double)draw(100) * 1e-4 : number();
    desk->real = number();
    desk->wants = draw(3) == 0;
    desk->count = draw(20) ? 0 : draw(FEW);
    desk->states = draw(9) ? STATES : draw(FEW), desk->limits = draw(9) ? INDICATORS : draw(FEW);
    desk->known = (fmi3ValueReference)(draw(40) ? draw(VARIABLES) : draw(UINT64_C(1) << 32));
    desk->unknown = (fmi3ValueReference)draw(VARIABLES);
    for (int i = 0; i < FEW; i++) {
        desk->references[i] = (fmi3ValueReference)(draw(40) ? draw(VARIABLES) : draw(UINT64_C(1) << 32));
        desk->reals[i] = draw(3) ? (double)draw(1000) / 100.0 : number();
        desk->integers[i] = (int64_t)draw(draw(9) ? 6 : UINT64_C(1) << 40);
    }
    if (draw(20) == 0) desk->bytes[draw(BYTES)] ^= 1;
    fmi3Status status = (draw(9) ? row->right : row->wrong)(desk->it);
    HOLDS(status == fmi3OK || status == fmi3Discard || status == fmi3Error);
}

static void calls(uint64_t seed, int turns)
{
    static Desk crowd[CROWD], quiet;
    lives(&quiet, HANDLING, RUNNING);
    State before = quiet.it->state;
    chance = seed;
    for (int i = 0; i < CROWD; i++) lives(&crowd[i], i % KINDS, INSTANTIATED);
    for (int turn = 0; turn < turns; turn++) {
        Desk *desk = &crowd[draw(CROWD)], *other = &crowd[draw(CROWD)];
        if (draw(20) == 0) dies(desk), lives(desk, (int)draw(KINDS), (int)draw(PHASES));
        fmi3FMUState state = desk->state;
        desk->state = other->state, other->state = state; /* which may be another's */
        desk->look = anything;
        anything(desk);
    }
    for (int i = 0; i < CROWD; i++) {
        Desk *desk = &crowd[i];
        fmi3ValueReference energy = reference_of("energy");
        desk->look = NULL, desk->t = 0.0, desk->h = 0.1, desk->wants = false;
        HOLDS(right_Reset(desk->it) == fmi3OK && right_EnterInitializationMode(desk->it) == fmi3OK);
        HOLDS(right_ExitInitializationMode(desk->it) == fmi3OK);
        if (desk->kind == HANDLING) HOLDS(right_EnterStepMode(desk->it) == fmi3OK);
        if (desk->kind != SOLVED) HOLDS(right_DoStep(desk->it) == fmi3OK);
        HOLDS(fmi3GetFloat64(desk->it, &energy, 1, &desk->real, 1) == fmi3OK && isfinite(desk->real));
        dies(desk);
    }
    HOLDS(!memcmp(&before, &quiet.it->state, sizeof before));
    dies(&quiet);
}

int main(int argc, char **argv)
{
    const char *what = argc > 2 ? argv[1] : "";
    if (!strcmp(what, "states")) printf("%d\n", together(atoi(argv[2])));
    else if (!strcmp(what, "calls") && argc == 4) calls(strtoull(argv[2], NULL, 10), atoi(argv[3]));
    else die("usage", __LINE__);
    return 0;
}
