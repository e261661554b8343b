/* Sentences to standard error, wherever that may lead; names as loggers expect them. */
#ifndef STDERR_OUTPUT_H
#define STDERR_OUTPUT_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "text_buffer.h"

#if defined(_WIN32)

/* Declared here, for windows.h takes words like far from the numerics. */
__declspec(dllimport) void *__stdcall GetStdHandle(unsigned long which);
__declspec(dllimport) int __stdcall WriteFile(void *file, const void *bytes, unsigned long length,
                                              unsigned long *written, void *overlapped);

/* Not through the C runtime, which ends the process when standard error is closed. */
static void write_to_stderr(const char *line, size_t length)
{
    unsigned long written;
    WriteFile(GetStdHandle((unsigned long)-12), line, (unsigned long)length, &written, NULL);
}

#elif defined(__unix__) || defined(__APPLE__)

#include <signal.h>
#include <unistd.h>

/* A pipe that nobody reads any more sends a signal that ends the process: it is held back in this thread, of which
 * sigprocmask is true on Linux and macOS, and taken away. */
static void write_to_stderr(const char *line, size_t length)
{
    sigset_t broken, before, pending;
    int awaited, taken;
    sigemptyset(&broken);
    sigaddset(&broken, SIGPIPE);
    sigprocmask(SIG_BLOCK, &broken, &before);
    sigpending(&pending);
    awaited = sigismember(&pending, SIGPIPE); /* by the importer, whose it stays */
    for (ssize_t written; length && (written = write(STDERR_FILENO, line, length)) > 0; length -= (size_t)written) {
        line += written;
    }
    sigpending(&pending);
    if (!awaited && sigismember(&pending, SIGPIPE)) sigwait(&broken, &taken);
    sigprocmask(SIG_SETMASK, &before, NULL);
}

#else

static void write_to_stderr(const char *line, size_t length) { fwrite(line, 1, length, stderr); }

#endif

/* The length of the character of UTF-8 that begins here; 0 if none does (RFC 3629, section 4). */
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

/* The name in UTF-8, which loggers expect: any other byte is told as \xff.  There is room for four times the length. */
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

/* On standard error, whatever has become of it. */
static void print_to_stderr(const char *instance, const char *sentence)
{
    size_t length = strlen(MODEL_NAME) + strlen(instance) + strlen(sentence) + strlen(" (): \n");
    char *line = malloc(length + 1);
    if (!line) return;
    snprintf(line, length + 1, "%s (%s): %s\n", MODEL_NAME, instance, sentence);
    write_to_stderr(line, length);
    free(line);
}

#endif
