/* A host without Python: runs a script of FMI calls on the library of an FMU for FMI 2.0 or, compiled with -DFMI3, 3.0.
 *
 *     host LIBRARY GUID RESOURCES THREADS < script
 *
 * Every thread runs the whole script with its own instances; all outputs must agree.  Each line is the number of an
 * instance and a command.  Each command prints a line: the status, then values as hexadecimal floats.
 *
 *     I new [exchange]           instantiate            I setup TOLERANCE START STOP   (nan: not given)
 *     I enter | exit | terminate | reset | free
 *     I step T H                 I run START STOP COUNT REFERENCE...   equal steps; the values after the last one
 *     I setr REFERENCE VALUE     I seti REFERENCE VALUE               I setb REFERENCE VALUE    I sets REFERENCE TEXT
 *     I getr REFERENCE...        I geti REFERENCE...                  I getb REFERENCE...       I gets REFERENCE...
 *     I save SLOT                I restore SLOT                       I drop SLOT
 *     I serialize SLOT BYTES     I deserialize SLOT BYTES             bytes are stored in slots too
 *     I truncate BYTES           one byte less                        I spoil BYTES             change the GUID
 *     I log ON CATEGORY...       I libraries                          of this process
 *
 * Model exchange:
 *     I euler STATES START STOP COUNT REFERENCE...    as `run`, by Euler's steps, each with an event
 *     I discrete                 update discrete states               I continuous              enter continuous time
 *     I event                    enter event mode                     I point T STATE...        set time and states
 *     I complete                 complete an integrator step
 *
 * FMI 2.0 only:
 *     I status                   I unsupported                        I other                   invalid instantiations
 */
#define _GNU_SOURCE
#ifdef _WIN32
#define strtok_r strtok_s
#else
#include <pthread.h>
#endif

#include "fmi_calls.h"

enum { INSTANCES = 1000, SLOTS = 16, WORDS = 40, THREADS = 32 };

typedef struct {
    const char *guid, *resources, *script;
    FILE *out;
    Log log;
    void *instances[INSTANCES];
    Experiment experiments[INSTANCES];
    SavedState states[SLOTS];
    char *bytes[SLOTS];
    size_t sizes[SLOTS];
} Player;

static void answer(Player *player, int status) { fprintf(player->out, "%d\n", status); }

static int references(char **words, int count, unsigned *out)
{
    for (int i = 0; i < count; i++) out[i] = (unsigned)strtoul(words[i], NULL, 10);
    return count;
}

static void print_reals(Player *player, int status, const double *values, int count)
{
    fprintf(player->out, "%d", status);
    for (int i = 0; i < count; i++) isnan(values[i]) ? fprintf(player->out, " nan") : fprintf(player->out, " %a", values[i]);
    fprintf(player->out, "\n");
}

static void run(Player *player, void *c, char **words, int count)
{
    unsigned requested[WORDS];
    double values[WORDS], start = strtod(words[0], NULL), stop = strtod(words[1], NULL), t = start;
    int steps = atoi(words[2]), size = references(words + 3, count - 3, requested);
    int status = get_reals(c, requested, (size_t)size, values);
    for (int i = 1; i <= steps && status == 0; i++) {
        double next = start + (stop - start) * i / steps;
        status = do_step(c, t, next - t);
        get_reals(c, requested, (size_t)size, values);
        t = next;
    }
    print_reals(player, status, values, size);
}

/* Starts and ends in event mode. */
static void euler(Player *player, void *c, size_t states, char **words, int count)
{
    unsigned requested[WORDS];
    double values[WORDS], x[WORDS], rates[WORDS], start = strtod(words[0], NULL), stop = strtod(words[1], NULL);
    int steps = atoi(words[2]), size = references(words + 3, count - 3, requested), status = 0;
    for (int i = 1; i <= steps; i++) {
        status |= update_discrete_states(c) | fmi.enter_continuous_time(c);
        status |= fmi.get_states(c, x, states) | fmi.get_rates(c, rates, states);
        for (size_t k = 0; k < states; k++) x[k] += (stop - start) / steps * rates[k];
        status |= fmi.set_time(c, start + (stop - start) * i / steps) | fmi.set_states(c, x, states);
        status |= fmi.enter_event_mode(c) | get_reals(c, requested, (size_t)size, values);
    }
    print_reals(player, status, values, size);
}

static int set_point(void *c, char **words, int count)
{
    double x[WORDS];
    for (int i = 1; i < count; i++) x[i - 1] = strtod(words[i], NULL);
    return fmi.set_time(c, strtod(words[0], NULL)) | fmi.set_states(c, x, (size_t)count - 1);
}

#ifndef FMI3
static void refused_instances(Player *player)
{
    void *c[] = {
        fmi.Instantiate("x", fmi2ModelExchange, "", "", &player->log, fmi2False, fmi2True),
        fmi.Instantiate("x", fmi2CoSimulation, "{of another}", "", &player->log, fmi2False, fmi2True),
        fmi.Instantiate("x", fmi2CoSimulation, NULL, "", NULL, fmi2False, fmi2True),
    };
    fprintf(player->out, "%d\n", c[0] || c[1] || c[2]);
    fmi.free_instance(NULL);
    fprintf(player->out, "%d\n", fmi.DoStep(NULL, 0.0, 1.0, fmi2True));
}

static void unsupported(Player *player, void *c)
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

static void print_status(Player *player, void *c)
{
    double last;
    int terminated, status = fmi.GetRealStatus(c, fmi2LastSuccessfulTime, &last);
    print_reals(player, status, &last, 1);
    status = fmi.GetBooleanStatus(c, fmi2Terminated, &terminated);
    fprintf(player->out, "%d %d\n", status, terminated);
}
#endif

static void values(Player *player, void *c, const char *command, char **words, int count)
{
    unsigned requested[WORDS];
    double reals[WORDS]; /* shows whether a refused call changes its output */
    Integer integers[WORDS];
    Flag flags[WORDS];
    const char *strings[WORDS];
    for (int i = 0; i < WORDS; i++) reals[i] = 77.0, integers[i] = 77, flags[i] = 1, strings[i] = "untouched";
    bool get = command[0] == 'g';
    size_t size = get ? (size_t)references(words, count, requested) : (size_t)references(words, 1, requested);
    int status;
    if (!get) {
        reals[0] = strtod(words[1], NULL), integers[0] = atoi(words[1]), flags[0] = atoi(words[1]), strings[0] = words[1];
    }
    switch (command[3]) {
    case 'r':
        status = get ? get_reals(c, requested, size, reals) : set_reals(c, requested, 1, reals);
        print_reals(player, status, reals, get ? (int)size : 0);
        return;
    case 'i': status = get ? get_integers(c, requested, size, integers) : set_integers(c, requested, 1, integers); break;
    case 'b': status = get ? get_flags(c, requested, size, flags) : set_flags(c, requested, 1, flags); break;
    default: status = get ? get_strings(c, requested, size, strings) : set_strings(c, requested, 1, strings); break;
    }
    fprintf(player->out, "%d", status);
    for (size_t i = 0; get && i < size; i++) {
        if (command[3] == 's') fprintf(player->out, " '%s'", strings[i]);
        else fprintf(player->out, " %d", command[3] == 'i' ? (int)integers[i] : (int)flags[i]);
    }
    fprintf(player->out, "\n");
}

static void serialize(Player *player, void *c, int state, int slot)
{
    answer(player, fmi.size_of_state(c, player->states[state], &player->sizes[slot]));
    player->bytes[slot] = realloc(player->bytes[slot], player->sizes[slot]);
    answer(player, fmi.serialize(c, player->states[state], (void *)player->bytes[slot], player->sizes[slot]));
}

static void print_libraries(Player *player)
{
    char line[512];
    FILE *maps = fopen("/proc/self/maps", "r");
    for (; maps && fgets(line, sizeof line, maps);) {
        if (strstr(line, ".so")) fprintf(player->out, "mapped %s", strchr(line, '/'));
    }
    if (maps) fclose(maps);
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
    void *c = player->instances[i];
    Flag event, terminate;
#define IS(name) (!strcmp(command, name))
    if (IS("new")) {
        char name[24];
        snprintf(name, sizeof name, "%d", i);
        player->instances[i] = instantiate(name, player->guid, player->resources, count > 2, &player->log);
        player->experiments[i] = (Experiment){NAN, 0.0, NAN};
        if (!player->instances[i]) die("no instance");
    } else if (IS("free")) {
        fmi.free_instance(c);
    } else if (IS("setup")) {
        player->experiments[i] = (Experiment){strtod(words[2], NULL), strtod(words[3], NULL), strtod(words[4], NULL)};
        answer(player, set_up(c, &player->experiments[i]));
    } else if (IS("enter")) {
        answer(player, enter_initialization(c, &player->experiments[i]));
    } else if (IS("exit")) {
        answer(player, fmi.exit_initialization(c));
    } else if (IS("terminate")) {
        answer(player, fmi.terminate(c));
    } else if (IS("reset")) {
        answer(player, fmi.reset(c));
    } else if (IS("step")) {
        answer(player, do_step(c, strtod(words[2], NULL), strtod(words[3], NULL)));
    } else if (IS("discrete")) {
        answer(player, update_discrete_states(c));
    } else if (IS("continuous")) {
        answer(player, fmi.enter_continuous_time(c));
    } else if (IS("event")) {
        answer(player, fmi.enter_event_mode(c));
    } else if (IS("point")) {
        answer(player, set_point(c, words + 2, count - 2));
    } else if (IS("complete")) {
        answer(player, fmi.complete_step(c, true, &event, &terminate));
    } else if (IS("run")) {
        run(player, c, words + 2, count - 2);
    } else if (IS("euler")) {
        euler(player, c, (size_t)a, words + 3, count - 3);
    } else if (!strncmp(command, "set", 3) || !strncmp(command, "get", 3)) {
        values(player, c, command, words + 2, count - 2);
    } else if (IS("save")) {
        answer(player, fmi.save(c, &player->states[a]));
    } else if (IS("restore")) {
        answer(player, fmi.restore(c, player->states[a]));
    } else if (IS("drop")) {
        answer(player, fmi.drop(c, &player->states[a]));
    } else if (IS("serialize")) {
        serialize(player, c, a, b);
    } else if (IS("deserialize")) {
        answer(player, fmi.deserialize(c, (void *)player->bytes[b], player->sizes[b], &player->states[a]));
    } else if (IS("truncate")) {
        player->sizes[a]--;
    } else if (IS("spoil")) {
        player->bytes[a][1] ^= 1;
    } else if (IS("log")) {
        answer(player, fmi.set_logging(c, a, (size_t)(count - 3), (const char *const *)words + 3));
    } else if (IS("libraries")) {
        print_libraries(player);
#ifndef FMI3
    } else if (IS("status")) {
        print_status(player, c);
    } else if (IS("unsupported")) {
        unsupported(player, c);
    } else if (IS("other")) {
        refused_instances(player);
#endif
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

/* Run all players at once, each in its own thread; a single one without threads, on any platform. */
static void run_all(Player *players, int count)
{
    if (count == 1) {
        players[0].out = stdout;
        open_log(&players[0].log, stdout);
        run_script(&players[0]);
        return;
    }
#ifndef _WIN32
    char *texts[THREADS];
    size_t lengths[THREADS];
    pthread_t threads[THREADS];
    for (int i = 0; i < count; i++) {
        players[i].out = open_memstream(&texts[i], &lengths[i]);
        open_log(&players[i].log, players[i].out);
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
    int count = argc == 5 ? atoi(argv[4]) : 0;
    if (count < 1 || count > THREADS) die("usage: host LIBRARY GUID RESOURCES THREADS < script");
    open_library(argv[1]);
    char *script = read_all(stdin);
    for (int i = 0; i < count; i++) {
        players[i].guid = argv[2], players[i].resources = argv[3], players[i].script = script;
    }
    run_all(players, count);
    free(script);
    return close_library() ? 0 : 1;
}
