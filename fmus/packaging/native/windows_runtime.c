/* Functions that our Windows libraries need in addition to the Universal C Runtime (UCRT). Linking UCRT directly uses
 * the same math functions as every other program on the machine, including Python. The compiler's MinGW layer would
 * bring its own and takes minutes to build. */
#include <stdarg.h>
#include <stddef.h>

int __stdio_common_vsprintf(unsigned long long options, char *text, size_t size, const char *format, void *locale,
                            va_list values);

/* UCRT does not export snprintf: Microsoft's stdio.h defines it inline. Option 2 selects the behaviour of the C
 * standard: the text is always null-terminated. */
int snprintf(char *text, size_t size, const char *format, ...)
{
    va_list values;
    int length;
    va_start(values, format);
    length = __stdio_common_vsprintf(2, text, size, format, NULL, values);
    va_end(values);
    return length;
}

/* Entry point of the library; there is nothing to initialise. */
int __stdcall DllMainCRTStartup(void *library, unsigned long reason, void *reserved)
{
    (void)library, (void)reason, (void)reserved;
    return 1;
}
