//! The metrics of the process, by the names of Prometheus' client libraries:
//! <https://prometheus.io/docs/instrumenting/writing_clientlibs/#process-metrics>.

/// The metrics as text; empty where the system has no `/proc`.
#[cfg(target_os = "linux")]
pub(super) fn metrics() -> String {
    linux::read().map(|values| linux::text(&values)).unwrap_or_default()
}

/// The metrics as text; empty where the system has no `/proc`.
#[cfg(not(target_os = "linux"))]
pub(super) fn metrics() -> String {
    String::new()
}

#[cfg(target_os = "linux")]
mod linux {
    use procfs::ProcResult;
    use procfs::process::{LimitValue, Process};

    /// Name, kind, description, value.
    type Row = (&'static str, &'static str, &'static str, f64);

    #[expect(clippy::cast_precision_loss, reason = "all are far below 2^52")]
    pub(super) fn read() -> ProcResult<[Row; 7]> {
        let process = Process::myself()?;
        let stat = process.stat()?;
        let ticks_per_s = procfs::ticks_per_second() as f64;
        let seconds = |ticks: u64| ticks as f64 / ticks_per_s;
        let started = procfs::boot_time_secs()? as f64 + seconds(stat.starttime);
        let max_fds = match process.limits()?.max_open_files.soft_limit {
            LimitValue::Value(n) => n as f64,
            LimitValue::Unlimited => f64::INFINITY,
        };
        let cpu = seconds(stat.utime + stat.stime);
        let (resident, all) = (stat.rss * procfs::page_size(), stat.vsize);
        let threads = stat.num_threads as f64;
        Ok([
            ("process_cpu_seconds_total", "counter", "User and system processor time", cpu),
            ("process_max_fds", "gauge", "Files that may be open", max_fds),
            ("process_open_fds", "gauge", "Open files", process.fd_count()? as f64),
            ("process_resident_memory_bytes", "gauge", "Resident memory", resident as f64),
            ("process_start_time_seconds", "gauge", "Start, s since 1970", started),
            ("process_threads", "gauge", "Threads", threads),
            ("process_virtual_memory_bytes", "gauge", "Virtual memory", all as f64),
        ])
    }

    pub(super) fn text(rows: &[Row]) -> String {
        let row = |(name, kind, help, value): &Row| {
            let value = if value.is_infinite() { "+Inf".to_owned() } else { value.to_string() };
            format!("# HELP {name} {help}\n# TYPE {name} {kind}\n{name} {value}\n")
        };
        rows.iter().map(row).collect()
    }

    #[cfg(test)]
    #[test]
    fn the_values_are_those_of_this_process() {
        let value = |name: &str| read().unwrap().iter().find(|row| row.0 == name).unwrap().3;
        let before = value("process_open_fds");
        let _files: Vec<_> = (0..10).map(|_| std::fs::File::open("/dev/null").unwrap()).collect();
        assert!(value("process_open_fds") >= before + 10.0);
        assert!(value("process_max_fds") > before);
        let memory = value("process_resident_memory_bytes");
        let held = vec![1_u8; 64 << 20];
        assert!(value("process_resident_memory_bytes") > memory + 32e6, "{}", held[7]);
        let now = std::time::UNIX_EPOCH.elapsed().unwrap().as_secs_f64();
        let age = now - value("process_start_time_seconds");
        assert!((-2.0..3600.0).contains(&age), "{age} s");
        // To fill the memory takes a tick of the clock or more.
        let cores = std::thread::available_parallelism().unwrap().get() as f64;
        let cpu = value("process_cpu_seconds_total");
        assert!(cpu > 0.0 && cpu < (age + 2.0) * cores, "{cpu} s in {age} s");
        assert!(value("process_threads") >= 1.0);
        assert!(value("process_virtual_memory_bytes") >= memory + 64e6);
    }
}
