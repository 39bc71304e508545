//! The memory available, so that a scene that is too large is refused instead of ending the program.

use std::fs;
use std::path::Path;

/// Bytes available without swapping: the least of Linux's `MemAvailable` and the rest of the limits of the control group and of the shell
/// (`ulimit -v`). `None` where the system reports none of them.
///
/// ```
/// assert!(bfree::memory::available().is_none_or(|bytes| bytes > 0));
/// ```
pub fn available() -> Option<u64> {
    let of_machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| meminfo(&text));
    let of_group = limit_left(Path::new("/sys/fs/cgroup"));
    let read = |path| fs::read_to_string(path).ok();
    let of_shell = read("/proc/self/limits").zip(read("/proc/self/status")).and_then(|(a, b)| address_space(&a, &b));
    [of_machine, of_group, of_shell].into_iter().flatten().min()
}

/// Gives the memory that the program has freed back to the operating system. glibc keeps what one thread has freed for that thread: after the set-up
/// of 512,000 particles, 100 MiB.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code)]
pub(crate) fn give_back() {
    unsafe extern "C" {
        safe fn malloc_trim(keep: usize) -> std::ffi::c_int;
    }
    malloc_trim(0);
}

/// Lets the program give arrays from 1 MiB on back to the operating system when it frees them. glibc would raise this size to
/// 32 MiB when such arrays are freed. With 512,000 particles in four processes, each process would keep 25 MiB more.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code)]
pub(crate) fn give_arrays_back() {
    use std::ffi::c_int;
    unsafe extern "C" {
        safe fn mallopt(parameter: c_int, value: c_int) -> c_int;
    }
    const M_MMAP_THRESHOLD: c_int = -3;
    mallopt(M_MMAP_THRESHOLD, 1 << 20);
}

/// Other systems have no such calls.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn give_back() {}

/// Other systems have no such calls.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn give_arrays_back() {}

/// `Max address space` of /proc/self/limits less `VmSize` of /proc/self/status, in bytes.
fn address_space(limits: &str, status: &str) -> Option<u64> {
    let used = number_after(status, "VmSize:")?.saturating_mul(1024);
    Some(number_after(limits, "Max address space")?.saturating_sub(used))
}

/// `MemAvailable:  123 kB` of /proc/meminfo, in bytes.
fn meminfo(text: &str) -> Option<u64> {
    number_after(text, "MemAvailable:")?.checked_mul(1024)
}

/// The number behind `key`, at the beginning of a line.
fn number_after(text: &str, key: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
}

/// The rest of the limit of a control group (version 2), in bytes. Caches of files do not count as used.
fn limit_left(group: &Path) -> Option<u64> {
    let read = |name: &str| fs::read_to_string(group.join(name)).ok();
    let number = |name: &str| read(name)?.trim().parse::<u64>().ok();
    let (limit, used) = (number("memory.max")?, number("memory.current")?);
    let cached = read("memory.stat").and_then(|text| number_after(&text, "inactive_file "));
    Some(limit.saturating_sub(used.saturating_sub(cached.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_linux_says_is_read() {
        let text = "MemTotal:       24689536 kB\nMemFree:         1000 kB\nMemAvailable:   23489008 kB\n";
        assert_eq!(meminfo(text), Some(23_489_008 * 1024));
        assert_eq!(meminfo("MemTotal: 5 kB\n"), None);
        assert_eq!(meminfo("MemAvailable: many kB\n"), None);
        let limits = "Limit                     Soft Limit           Hard Limit           Units\nMax address space         409600000            unlimited            bytes\n";
        assert_eq!(address_space(limits, "Name: x\nVmSize:\t  100000 kB\n"), Some(409_600_000 - 102_400_000));
        assert_eq!(address_space("Max address space  unlimited  unlimited  bytes\n", "VmSize: 1 kB\n"), None);
    }

    #[test]
    fn a_limit_counts_what_cannot_be_given_back() {
        let group = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(group.path().join(name), text).unwrap();
        assert_eq!(limit_left(group.path()), None);
        write("memory.current", "700\n");
        write("memory.max", "max\n");
        assert_eq!(limit_left(group.path()), None, "no limit");
        write("memory.max", "1000\n");
        assert_eq!(limit_left(group.path()), Some(300));
        write("memory.stat", "anon 500\ninactive_file 200\n");
        assert_eq!(limit_left(group.path()), Some(500));
    }
}
