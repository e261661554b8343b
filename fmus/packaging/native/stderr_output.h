/* Messages to standard error, even when it is closed or a broken pipe; instance names as valid UTF-8. */
#ifndef STDERR_OUTPUT_H
#define STDERR_OUTPUT_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "text_buffer.h"

#if defined(_WIN32)

/* Declared here because windows.h defines macros such as `far`, which clash with names in the generated code. */
__declspec(dllimport) void *__stdcall GetStdHandle(unsigned long which);
__declspec(dllimport) int __stdcall WriteFile(void *file, const void *bytes, unsigned long length,
                                              unsigned long *written, void *overlapped);

/* Bypass the C runtime, which ends the process if standard error is closed. */
static void write_to_stderr(const char *line, size_t length)
{
    unsigned long written;
    WriteFile(GetStdHandle((unsigned long)-12), line, (unsigned long)length, &written, NULL);
}

#elif defined(__unix__) || defined(__APPLE__)

#include <signal.h>
#include <unistd.h>

/* Writing to a pipe without a reader raises SIGPIPE, which would end the process. Block the signal in this thread and
 * consume it, unless it was pending before: then it belongs to the importer. (On Linux and macOS, sigprocmask affects
 * the calling thread only.) */
static void write_to_stderr(const char *line, size_t length)
{
    sigset_t sigpipe, old_mask, pending;
    int was_pending, signal_number;
    sigemptyset(&sigpipe);
    sigaddset(&sigpipe, SIGPIPE);
    sigprocmask(SIG_BLOCK, &sigpipe, &old_mask);
    sigpending(&pending);
    was_pending = sigismember(&pending, SIGPIPE);
    for (ssize_t written; length && (written = write(STDERR_FILENO, line, length)) > 0; length -= (size_t)written) {
        line += written;
    }
    sigpending(&pending);
    if (!was_pending && sigismember(&pending, SIGPIPE)) sigwait(&sigpipe, &signal_number);
    sigprocmask(SIG_SETMASK, &old_mask, NULL);
}

#else

static void write_to_stderr(const char *line, size_t length) { fwrite(line, 1, length, stderr); }

#endif

/* Length in bytes of the UTF-8 character at c, or 0 if the bytes are not valid UTF-8 (RFC 3629, section 4). */
static size_t utf8_length(const unsigned char *c)
{
    size_t length = *c < 0x80 ? 1 : *c < 0xC2 ? 0 : *c < 0xE0 ? 2 : *c < 0xF0 ? 3 : *c < 0xF5 ? 4 : 0;
    for (size_t i = 1; i < length; i++) {
        if ((c[i] & 0xC0) != 0x80) return 0;
    }
    if ((*c == 0xE0 && c[1] < 0xA0) || (*c == 0xED && c[1] > 0x9F) || (*c == 0xF0 && c[1] < 0x90) ||
        (*c == 0xF4 && c[1] > 0x8F)) {
        return 0;
    }
    return length;
}

/* Copy a name as valid UTF-8, which loggers expect. Other bytes become escapes such as \xff, so the copy needs up to
 * four times the length. */
static void copy_as_utf8(char *copy, const char *name)
{
    while (*name) {
        size_t length = utf8_length((const unsigned char *)name);
        if (length) memcpy(copy, name, length);
        else snprintf(copy, 5, "\\x%02x", (unsigned char)*name);
        copy += length ? length : 4;
        name += length ? length : 1;
    }
    *copy = '\0';
}

/* Print "model (instance): message" to standard error. */
static void print_to_stderr(const char *instance, const char *message)
{
    size_t length = strlen(MODEL_NAME) + strlen(instance) + strlen(message) + strlen(" (): \n");
    char *line = malloc(length + 1);
    if (!line) return;
    snprintf(line, length + 1, "%s (%s): %s\n", MODEL_NAME, instance, message);
    write_to_stderr(line, length);
    free(line);
}

#endif
