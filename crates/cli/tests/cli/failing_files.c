/* Counts the calls by which a program uses files below a folder, and lets one of them fail: loaded before the C library.
 *
 * FAIL_UNDER names the folder, FAIL_AT the number of the call, from 1, and FAIL_LOG a file outside of it, to which the kind and the
 * path of the call that failed are written. A write that fails writes a half first, as on a disk that is full. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#define MOST 4096
static char *paths[MOST];
static DIR *folders[MOST];
static char *folder_paths[MOST];
static atomic_long calls;
static atomic_int full = -1;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

/* The whole path, if it lies below the folder. */
static char *below(const char *path) {
    const char *under = getenv("FAIL_UNDER");
    char whole[2 * PATH_MAX];
    if (under == NULL || path == NULL)
        return NULL;
    if (path[0] == '/') {
        snprintf(whole, sizeof whole, "%s", path);
    } else {
        char here[PATH_MAX];
        if (getcwd(here, sizeof here) == NULL)
            return NULL;
        snprintf(whole, sizeof whole, "%s/%s", here, path);
    }
    size_t length = strlen(under);
    if (strncmp(whole, under, length) != 0 || whole[length] != '/' || strstr(whole, "/../") != NULL)
        return NULL;
    return strdup(whole);
}

static int fails(const char *kind, const char *path) {
    if (path == NULL)
        return 0;
    const char *at = getenv("FAIL_AT"), *log = getenv("FAIL_LOG");
    long call = atomic_fetch_add(&calls, 1) + 1;
    /* The end of a folder is told by an error number that is unchanged. */
    int before = errno;
    long wanted = at == NULL ? 0 : atol(at);
    errno = before;
    if (log == NULL || call != wanted)
        return 0;
    int file = syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_TRUNC, 0666);
    char line[2 * PATH_MAX];
    int length = snprintf(line, sizeof line, "%s %s", kind, path);
    syscall(SYS_write, file, line, length);
    syscall(SYS_close, file);
    return 1;
}

static const char *of(int file) {
    return file >= 0 && file < MOST ? paths[file] : NULL;
}

static int fail_path(const char *kind, const char *path) {
    char *whole = below(path);
    int failed = fails(kind, whole);
    free(whole);
    if (failed)
        errno = EIO;
    return failed;
}

static int fail_file(const char *kind, int file) {
    if (!fails(kind, of(file)))
        return 0;
    errno = EIO;
    return 1;
}

static int opened(int file, const char *path) {
    if (file >= 0 && file < MOST) {
        free(paths[file]);
        paths[file] = below(path);
    }
    return file;
}

static mode_t mode_of(int flags, va_list rest) {
    return flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;
}

int open(const char *path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    mode_t mode = mode_of(flags, rest);
    va_end(rest);
    return fail_path("open", path) ? -1 : opened(REAL(open)(path, flags, mode), path);
}

int open64(const char *path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    mode_t mode = mode_of(flags, rest);
    va_end(rest);
    return fail_path("open", path) ? -1 : opened(REAL(open64)(path, flags, mode), path);
}

int close(int file) {
    if (file >= 0 && file < MOST) {
        free(paths[file]);
        paths[file] = NULL;
    }
    int expected = file;
    atomic_compare_exchange_strong(&full, &expected, -1);
    return REAL(close)(file);
}

ssize_t read(int file, void *bytes, size_t count) {
    return fail_file("read", file) ? -1 : REAL(read)(file, bytes, count);
}

ssize_t write(int file, const void *bytes, size_t count) {
    if (atomic_load(&full) == file && of(file) != NULL) {
        atomic_store(&full, -1);
        errno = ENOSPC;
        return -1;
    }
    if (fails("write", of(file))) {
        if (count > 1) {
            atomic_store(&full, file);
            return REAL(write)(file, bytes, count / 2);
        }
        errno = ENOSPC;
        return -1;
    }
    return REAL(write)(file, bytes, count);
}

int fsync(int file) {
    return fail_file("fsync", file) ? -1 : REAL(fsync)(file);
}

int fdatasync(int file) {
    return fail_file("fdatasync", file) ? -1 : REAL(fdatasync)(file);
}

int flock(int file, int operation) {
    return fail_file("flock", file) ? -1 : REAL(flock)(file, operation);
}

int ftruncate64(int file, off64_t length) {
    return fail_file("ftruncate", file) ? -1 : REAL(ftruncate64)(file, length);
}

off64_t lseek64(int file, off64_t offset, int whence) {
    return fail_file("lseek", file) ? -1 : REAL(lseek64)(file, offset, whence);
}

int rename(const char *from, const char *to) {
    return fail_path("rename", to) ? -1 : REAL(rename)(from, to);
}

int unlink(const char *path) {
    return fail_path("unlink", path) ? -1 : REAL(unlink)(path);
}

int mkdir(const char *path, mode_t mode) {
    return fail_path("mkdir", path) ? -1 : REAL(mkdir)(path, mode);
}

char *realpath(const char *path, char *resolved) {
    return fail_path("realpath", path) ? NULL : REAL(realpath)(path, resolved);
}

int statx(int folder, const char *path, int flags, unsigned mask, struct statx *found) {
    /* Callers ask with no path whether the call is there, which its declaration denies. */
    const char *volatile given = path;
    if (given == NULL)
        return REAL(statx)(folder, path, flags, mask, found);
    int failed = given[0] == 0 ? fail_file("stat", folder) : folder == AT_FDCWD && fail_path("stat", given);
    return failed ? -1 : REAL(statx)(folder, path, flags, mask, found);
}

DIR *opendir(const char *path) {
    if (fail_path("opendir", path))
        return NULL;
    DIR *folder = REAL(opendir)(path);
    for (int place = 0; folder != NULL && place < MOST; ++place) {
        if (folders[place] == NULL) {
            folders[place] = folder;
            folder_paths[place] = below(path);
            break;
        }
    }
    return folder;
}

struct dirent64 *readdir64(DIR *folder) {
    for (int place = 0; place < MOST; ++place) {
        if (folders[place] == folder && fails("readdir", folder_paths[place])) {
            errno = EIO;
            return NULL;
        }
    }
    return REAL(readdir64)(folder);
}

int closedir(DIR *folder) {
    for (int place = 0; place < MOST; ++place) {
        if (folders[place] == folder) {
            free(folder_paths[place]);
            folders[place] = NULL;
            folder_paths[place] = NULL;
        }
    }
    return REAL(closedir)(folder);
}
