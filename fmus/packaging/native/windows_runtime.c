/* What our libraries for Windows need beside its C runtime (UCRT), whose functions of mathematics are those of every
 * program there, Python among them.  The compiler's own layer over it would bring others, and takes minutes to make. */
#include <stdarg.h>
#include <stddef.h>

int __stdio_common_vsprintf(unsigned long long options, char *text, size_t size, const char *format, void *locale,
                            va_list values);

/* In UCRT a function that Microsoft's headers write out (stdio.h); 2: as the standard has it, ended by a zero. */
int snprintf(char *text, size_t size, const char *format, ...)
{
    va_list values;
    int length;
    va_start(values, format);
    length = __stdio_common_vsprintf(2, text, size, format, NULL, values);
    va_end(values);
    return length;
}

/* Where Windows enters the library: nothing is to be done. */
int __stdcall DllMainCRTStartup(void *library, unsigned long reason, void *reserved)
{
    (void)library, (void)reason, (void)reserved;
    return 1;
}
