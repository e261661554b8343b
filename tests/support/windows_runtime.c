/* What the hosts need on Windows beside its C runtime (UCRT): how a program begins, and the functions for which
 * Microsoft's headers have the text.  The compiler's own layer over it would take minutes to make. */
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

void __main(void) {} /* called first by main: constructors, of which there are none */

void mainCRTStartup(void)
{
    _configure_narrow_argv(1); /* the words as they are */
    setvbuf(stderr, NULL, _IONBF, 0); /* which Wine buffers where it is a pipe */
    exit(main(*__p___argc(), *__p___argv()));
}
