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

/* The compiler calls this for functions with more than 4 kB of local variables, which large models have. rax is the size
 * of the new stack frame. Windows allocates the pages of a stack one by one, so each page must be touched in order.
 * All registers keep their values. */
__asm__(".globl ___chkstk_ms\n"
        "___chkstk_ms:\n"
        "    pushq %rcx\n"
        "    pushq %rax\n"
        "    leaq 24(%rsp), %rcx\n" /* the stack pointer of the caller */
        "    cmpq $0x1000, %rax\n"
        "    jb 2f\n"
        "1:\n"
        "    subq $0x1000, %rcx\n"
        "    testq %rcx, (%rcx)\n"
        "    subq $0x1000, %rax\n"
        "    cmpq $0x1000, %rax\n"
        "    ja 1b\n"
        "2:\n"
        "    subq %rax, %rcx\n"
        "    testq %rcx, (%rcx)\n"
        "    popq %rax\n"
        "    popq %rcx\n"
        "    retq\n");
