/* A host without Python: runs a script of FMI calls on the library of an FMU.
 *
 *     host LIBRARY GUID THREADS < script
 *
 * Every thread runs the whole script with its own instances; all outputs must agree.  Each line is the number of an
 * instance and a command.  Each command prints a line: the status, then values as hexadecimal floats.
 *
 *     I new [exchange]           instantiate            I setup TOLERANCE START STOP   (nan: not given)
 *     I enter | exit | terminate | reset | free
 *     I step T H                 I run START STOP COUNT REFERENCE...   equal steps; the values after the last one
 *     I euler STATES START STOP COUNT REFERENCE...    the same by Euler's steps in model exchange, each with an event
 *     I setr REFERENCE VALUE     I seti REFERENCE VALUE               I setb REFERENCE VALUE    I sets REFERENCE TEXT
 *     I getr REFERENCE...        I geti REFERENCE...                  I getb REFERENCE...       I gets REFERENCE...
 *     I save SLOT                I restore SLOT                       I drop SLOT
 *     I serialize SLOT BYTES     I deserialize SLOT BYTES             bytes are stored in slots too
 *     I truncate BYTES           one byte less                        I spoil BYTES             change the GUID
 *     I log ON CATEGORY...       I status                             I unsupported
 *     I other                    invalid instantiations
 */
#define _GNU_SOURCE
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef _WIN32
#define strtok_r strtok_s
#else
#include <pthread.h>
#endif

#include "fmi2FunctionTypes.h"
#include "library.h"

enum { INSTANCES = 1000, SLOTS = 16, WORDS = 40, THREADS = 32 };

#define FUNCTIONS(f)                                                                                                  \
    f(GetTypesPlatform) f(GetVersion) f(Instantiate) f(FreeInstance) f(SetDebugLogging) f(SetupExperiment)            \
    f(EnterInitializationMode) f(ExitInitializationMode) f(Terminate) f(Reset) f(GetReal) f(GetInteger) f(GetBoolean) \
    f(GetString) f(SetReal) f(SetInteger) f(SetBoolean) f(SetString) f(GetFMUstate) f(SetFMUstate) f(FreeFMUstate)    \
    f(SerializedFMUstateSize) f(SerializeFMUstate) f(DeSerializeFMUstate) f(GetDirectionalDerivative)                 \
    f(SetRealInputDerivatives) f(GetRealOutputDerivatives) f(DoStep) f(CancelStep) f(GetStatus) f(GetRealStatus)      \
    f(GetIntegerStatus) f(GetBooleanStatus) f(GetStringStatus) f(EnterEventMode) f(NewDiscreteStates)                 \
    f(EnterContinuousTimeMode) f(SetTime) f(GetContinuousStates) f(SetContinuousStates) f(GetDerivatives)

static struct {
#define DECLARE(name) fmi2##name##TYPE *name;
    FUNCTIONS(DECLARE)
} fmi;

typedef struct {
    const char *guid, *script;
    FILE *out;
    fmi2CallbackFunctions callbacks;
    fmi2Component instances[INSTANCES];
    fmi2FMUstate states[SLOTS];
    char *bytes[SLOTS];
    size_t sizes[SLOTS];
} Player;

static void on_log(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    Player *player = environment;
    va_list values;
    va_start(values, message);
    fprintf(player->out, "log %s %d %s ", instance, status, category);
    vfprintf(player->out, message, values);
    fprintf(player->out, "\n");
    va_end(values);
}

static void answer(Player *player, fmi2Status status) { fprintf(player->out, "%d\n", status); }

static int references(char **words, int count, fmi2ValueReference *out)
{
    for (int i = 0; i < count; i++) out[i] = (fmi2ValueReference)strtoul(words[i], NULL, 10);
    return count;
}

static void print_reals(Player *player, fmi2Status status, const double *values, int count)
{
    fprintf(player->out, "%d", status);
    for (int i = 0; i < count; i++) isnan(values[i]) ? fprintf(player->out, " nan") : fprintf(player->out, " %a", values[i]);
    fprintf(player->out, "\n");
}

static void run(Player *player, fmi2Component c, char **words, int count)
{
    fmi2ValueReference requested[WORDS];
    double values[WORDS], start = strtod(words[0], NULL), stop = strtod(words[1], NULL), t = start;
    int steps = atoi(words[2]), size = references(words + 3, count - 3, requested);
    fmi2Status status = fmi.GetReal(c, requested, (size_t)size, values);
    for (int i = 1; i <= steps && status == fmi2OK; i++) {
        double next = start + (stop - start) * i / steps;
        status = fmi.DoStep(c, t, next - t, fmi2True);
        fmi.GetReal(c, requested, (size_t)size, values);
        t = next;
    }
    print_reals(player, status, values, size);
}

/* Starts and ends in event mode. */
static void euler(Player *player, fmi2Component c, size_t states, char **words, int count)
{
    fmi2ValueReference requested[WORDS];
    double values[WORDS], x[WORDS], rates[WORDS], start = strtod(words[0], NULL), stop = strtod(words[1], NULL);
    int steps = atoi(words[2]), size = references(words + 3, count - 3, requested), status = fmi2OK;
    fmi2EventInfo event;
    for (int i = 1; i <= steps; i++) {
        status |= fmi.NewDiscreteStates(c, &event) | fmi.EnterContinuousTimeMode(c);
        status |= fmi.GetContinuousStates(c, x, states) | fmi.GetDerivatives(c, rates, states);
        for (size_t k = 0; k < states; k++) x[k] += (stop - start) / steps * rates[k];
        status |= fmi.SetTime(c, start + (stop - start) * i / steps) | fmi.SetContinuousStates(c, x, states);
        status |= fmi.EnterEventMode(c) | fmi.GetReal(c, requested, (size_t)size, values);
    }
    print_reals(player, (fmi2Status)status, values, size);
}

static void refused_instances(Player *player)
{
    fmi2Component c[] = {
        fmi.Instantiate("x", fmi2ModelExchange, "", "", &player->callbacks, fmi2False, fmi2True),
        fmi.Instantiate("x", fmi2CoSimulation, "{of another}", "", &player->callbacks, fmi2False, fmi2True),
        fmi.Instantiate("x", fmi2CoSimulation, NULL, "", NULL, fmi2False, fmi2True),
    };
    fprintf(player->out, "%d\n", c[0] || c[1] || c[2]);
    fmi.FreeInstance(NULL);
    fprintf(player->out, "%d\n", fmi.DoStep(NULL, 0.0, 1.0, fmi2True));
}

static void unsupported(Player *player, fmi2Component c)
{
    fmi2ValueReference reference = 0;
    fmi2Integer order = 1, integer;
    fmi2Real real = 0.0, other = 0.0;
    fmi2Status status;
    fmi2String string;
    answer(player, fmi.GetDirectionalDerivative(c, &reference, 1, &reference, 1, &real, &other));
    answer(player, fmi.SetRealInputDerivatives(c, &reference, 1, &order, &real));
    answer(player, fmi.GetRealOutputDerivatives(c, &reference, 1, &order, &real));
    answer(player, fmi.CancelStep(c));
    answer(player, fmi.GetStatus(c, fmi2DoStepStatus, &status));
    answer(player, fmi.GetIntegerStatus(c, fmi2DoStepStatus, &integer));
    answer(player, fmi.GetStringStatus(c, fmi2PendingStatus, &string));
    answer(player, fmi.GetRealStatus(c, fmi2DoStepStatus, &real));
    answer(player, fmi.GetBooleanStatus(c, fmi2DoStepStatus, &integer));
}

static void values(Player *player, fmi2Component c, const char *command, char **words, int count)
{
    fmi2ValueReference requested[WORDS];
    fmi2Real reals[WORDS]; /* shows whether a refused call changes its output */
    fmi2Integer integers[WORDS];
    fmi2String strings[WORDS];
    for (int i = 0; i < WORDS; i++) reals[i] = 77.0, integers[i] = 77, strings[i] = "untouched";
    bool get = command[0] == 'g';
    size_t size = get ? (size_t)references(words, count, requested) : (size_t)references(words, 1, requested);
    fmi2Status status;
    if (!get) {
        reals[0] = strtod(words[1], NULL), integers[0] = atoi(words[1]), strings[0] = words[1];
    }
    switch (command[3]) {
    case 'r':
        if (get) print_reals(player, fmi.GetReal(c, requested, size, reals), reals, (int)size);
        else answer(player, fmi.SetReal(c, requested, 1, reals));
        return;
    case 'i': status = get ? fmi.GetInteger(c, requested, size, integers) : fmi.SetInteger(c, requested, 1, integers); break;
    case 'b': status = get ? fmi.GetBoolean(c, requested, size, integers) : fmi.SetBoolean(c, requested, 1, integers); break;
    default: status = get ? fmi.GetString(c, requested, size, strings) : fmi.SetString(c, requested, 1, strings); break;
    }
    fprintf(player->out, "%d", status);
    for (size_t i = 0; get && i < size; i++) {
        if (command[3] == 's') fprintf(player->out, " '%s'", strings[i]);
        else fprintf(player->out, " %d", integers[i]);
    }
    fprintf(player->out, "\n");
}

static void serialize(Player *player, fmi2Component c, int state, int slot)
{
    answer(player, fmi.SerializedFMUstateSize(c, player->states[state], &player->sizes[slot]));
    player->bytes[slot] = realloc(player->bytes[slot], player->sizes[slot]);
    answer(player, fmi.SerializeFMUstate(c, player->states[state], player->bytes[slot], player->sizes[slot]));
}

static void play(Player *player, char *line)
{
    char *words[WORDS], *rest = NULL;
    int count = 0;
    for (char *word = strtok_r(line, " ", &rest); word && count < WORDS; word = strtok_r(NULL, " ", &rest)) {
        words[count++] = word;
    }
    if (count < 2) die("a command has an instance and a name");
    int i = atoi(words[0]), a = count > 2 ? atoi(words[2]) : 0, b = count > 3 ? atoi(words[3]) : 0;
    const char *command = words[1];
    fmi2Component c = player->instances[i];
#define IS(name) (!strcmp(command, name))
    if (IS("new")) {
        char name[24];
        snprintf(name, sizeof name, "%d", i);
        player->instances[i] =
            fmi.Instantiate(name, count > 2 ? fmi2ModelExchange : fmi2CoSimulation, player->guid, "", &player->callbacks, fmi2False, fmi2True);
        if (!player->instances[i]) die("no instance");
    } else if (IS("free")) {
        fmi.FreeInstance(c);
    } else if (IS("setup")) {
        double tolerance = strtod(words[2], NULL), start = strtod(words[3], NULL), stop = strtod(words[4], NULL);
        answer(player, fmi.SetupExperiment(c, !isnan(tolerance), tolerance, start, !isnan(stop), stop));
    } else if (IS("enter")) {
        answer(player, fmi.EnterInitializationMode(c));
    } else if (IS("exit")) {
        answer(player, fmi.ExitInitializationMode(c));
    } else if (IS("terminate")) {
        answer(player, fmi.Terminate(c));
    } else if (IS("reset")) {
        answer(player, fmi.Reset(c));
    } else if (IS("step")) {
        answer(player, fmi.DoStep(c, strtod(words[2], NULL), strtod(words[3], NULL), fmi2True));
    } else if (IS("run")) {
        run(player, c, words + 2, count - 2);
    } else if (IS("euler")) {
        euler(player, c, (size_t)a, words + 3, count - 3);
    } else if (!strncmp(command, "set", 3) || !strncmp(command, "get", 3)) {
        values(player, c, command, words + 2, count - 2);
    } else if (IS("save")) {
        answer(player, fmi.GetFMUstate(c, &player->states[a]));
    } else if (IS("restore")) {
        answer(player, fmi.SetFMUstate(c, player->states[a]));
    } else if (IS("drop")) {
        answer(player, fmi.FreeFMUstate(c, &player->states[a]));
    } else if (IS("serialize")) {
        serialize(player, c, a, b);
    } else if (IS("deserialize")) {
        answer(player, fmi.DeSerializeFMUstate(c, player->bytes[b], player->sizes[b], &player->states[a]));
    } else if (IS("truncate")) {
        player->sizes[a]--;
    } else if (IS("spoil")) {
        player->bytes[a][1] ^= 1;
    } else if (IS("log")) {
        answer(player, fmi.SetDebugLogging(c, a, (size_t)(count - 3), (const fmi2String *)words + 3));
    } else if (IS("status")) {
        double last;
        int terminated;
        fmi2Status status = fmi.GetRealStatus(c, fmi2LastSuccessfulTime, &last);
        print_reals(player, status, &last, 1);
        status = fmi.GetBooleanStatus(c, fmi2Terminated, &terminated);
        fprintf(player->out, "%d %d\n", status, terminated);
    } else if (IS("unsupported")) {
        unsupported(player, c);
    } else if (IS("other")) {
        refused_instances(player);
    } else {
        die(command);
    }
}

static void *run_script(void *argument)
{
    Player *player = argument;
    char *script = strdup(player->script), *rest = NULL;
    for (char *line = strtok_r(script, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) play(player, line);
    for (int i = 0; i < SLOTS; i++) free(player->bytes[i]);
    free(script);
    return NULL;
}

static char *read_all(FILE *file)
{
    size_t size = 0, capacity = 1 << 16;
    char *text = malloc(capacity);
    for (size_t n_read; (n_read = fread(text + size, 1, capacity - size - 1, file)) > 0;) {
        size += n_read;
        if (capacity - size < 2) text = realloc(text, capacity *= 2);
    }
    text[size] = '\0';
    return text;
}

static void load(const char *path)
{
    void *library = open_library(path);
#define FIND(name) *(void **)&fmi.name = find_function(library, "fmi2" #name);
    FUNCTIONS(FIND)
}

/* Print the libraries in this process, one per line, to standard error. */
static void print_libraries(void)
{
    char line[512];
    FILE *maps = fopen("/proc/self/maps", "r");
    for (; maps && fgets(line, sizeof line, maps);) {
        if (strstr(line, ".so")) fprintf(stderr, "mapped %s", strchr(line, '/'));
    }
    if (maps) fclose(maps);
}

/* Run all players at once, each in its own thread; a single one without threads, on any platform. */
static void run_all(Player *players, int count)
{
    if (count == 1) {
        players[0].out = stdout;
        run_script(&players[0]);
        return;
    }
#ifndef _WIN32
    char *texts[THREADS];
    size_t lengths[THREADS];
    pthread_t threads[THREADS];
    for (int i = 0; i < count; i++) {
        players[i].out = open_memstream(&texts[i], &lengths[i]);
        if (pthread_create(&threads[i], NULL, run_script, &players[i])) die("no thread");
    }
    for (int i = 0; i < count; i++) pthread_join(threads[i], NULL);
    for (int i = 0; i < count; i++) fclose(players[i].out);
    fputs(texts[0], stdout);
    for (int i = count - 1; i >= 0; i--) {
        if (strcmp(texts[i], texts[0])) die("two threads differ");
        if (i) free(texts[i]);
    }
    free(texts[0]);
#endif
}

int main(int argc, char **argv)
{
    static Player players[THREADS];
    struct timespec from, to;
    int count = argc == 4 ? atoi(argv[3]) : 0;
    if (count < 1 || count > THREADS) die("usage: host LIBRARY GUID THREADS < script");
    load(argv[1]);
    char *script = read_all(stdin);
    for (int i = 0; i < count; i++) {
        players[i].guid = argv[2], players[i].script = script;
        players[i].callbacks = (fmi2CallbackFunctions){on_log, calloc, free, NULL, &players[i]};
    }
    timespec_get(&from, TIME_UTC);
    run_all(players, count);
    timespec_get(&to, TIME_UTC);
    free(script);
    fprintf(stderr, "seconds %.9f\n", (double)(to.tv_sec - from.tv_sec) + 1e-9 * (double)(to.tv_nsec - from.tv_nsec));
    print_libraries();
    return 0;
}
