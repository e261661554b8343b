/* Additions to the C runtime of Windows (UCRT): the program entry point, and functions that Microsoft's headers define
 * inline.  Building the compiler's own layer would take minutes. */
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

int _configure_narrow_argv(int mode);
int main(int count, char **words);

int vfprintf(FILE *file, const char *format, va_list values)
{
    return __stdio_common_vfprintf(0, file, format, NULL, values);
}

int fprintf(FILE *file, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    int length = vfprintf(file, format, values);
    va_end(values);
    return length;
}

int printf(const char *format, ...)
{
    va_list values;
    va_start(values, format);
    int length = vfprintf(stdout, format, values);
    va_end(values);
    return length;
}

void __main(void) {} /* called first by main: there are no constructors */

void mainCRTStartup(void)
{
    _configure_narrow_argv(1); /* unexpanded arguments */
    setvbuf(stderr, NULL, _IONBF, 0); /* Wine buffers it if it is a pipe */
    exit(main(*__p___argc(), *__p___argv()));
}
