/* Load the library of an FMU, on any platform. */
#ifndef LIBRARY_H
#define LIBRARY_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

static void die(const char *what)
{
    fprintf(stderr, "host: %s\n", what);
    exit(1);
}

static void *open_library(const char *path)
{
#ifdef _WIN32
    void *library = LoadLibraryA(path);
#else
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
#endif
    if (!library) die("the library does not load");
    return library;
}

static void *find_function(void *library, const char *name)
{
#ifdef _WIN32
    void *function = (void *)GetProcAddress((HMODULE)library, name);
#else
    void *function = dlsym(library, name);
#endif
    if (!function) die(name);
    return function;
}

static inline bool close_library(void *library)
{
#ifdef _WIN32
    return FreeLibrary((HMODULE)library);
#else
    return !dlclose(library);
#endif
}

#endif
