//! Standard error without a line that drivers print there.
//!
//! A session may have no `XDG_RUNTIME_DIR`, as in containers and over SSH. A Vulkan layer of Mesa that looks
//! for a Wayland compositor then makes libwayland print an error. Nothing is wrong, and nothing in an
//! instance's settings prevents it.

/// Looks for GPUs; libwayland's line is left out of standard error, and everything else passes.
#[cfg(unix)]
pub(crate) fn quietly<R>(look: impl FnOnce() -> R) -> R {
    use std::path::Path;
    let folder = std::env::var_os("XDG_RUNTIME_DIR");
    // With an absolute path there is no such line.
    if folder.is_some_and(|folder| Path::new(&folder).is_absolute()) {
        return look();
    }
    let Ok(filter) = unix::Filter::begin() else { return look() };
    let found = look();
    drop(filter);
    found
}

/// Looks for GPUs.
#[cfg(not(unix))]
pub(crate) fn quietly<R>(look: impl FnOnce() -> R) -> R {
    look()
}

#[cfg(unix)]
mod unix {
    use rustix::stdio::dup2_stderr;
    use std::fs::File;
    use std::io::{self, BufRead, BufReader, PipeReader, Write, pipe, stderr};
    use std::os::fd::AsFd;
    use std::sync::mpsc::{Receiver, channel};
    use std::thread;
    use std::time::Duration;

    /// What libwayland prints.
    const WAYLAND: &[u8] = b"error: XDG_RUNTIME_DIR is invalid or not set in the environment.";
    /// How long the end is waited for: a process that a driver left behind may hold the pipe.
    const PATIENCE: Duration = Duration::from_secs(1);

    /// Standard error while it leads through a filter; as before when this is dropped.
    pub(super) struct Filter {
        before: File,
        done: Receiver<()>,
    }

    impl Filter {
        pub(super) fn begin() -> io::Result<Self> {
            let before = File::from(stderr().as_fd().try_clone_to_owned()?);
            let to = before.try_clone()?;
            let (reader, writer) = pipe()?;
            dup2_stderr(&writer)?;
            let (tell, done) = channel();
            thread::spawn(move || {
                // Nobody is left to tell.
                let _ = pass(reader, to);
                let _ = tell.send(());
            });
            Ok(Self { before, done })
        }
    }

    impl Drop for Filter {
        fn drop(&mut self) {
            // The pipe has no other writer, so that it ends here.
            if dup2_stderr(&self.before).is_ok() {
                let _ = self.done.recv_timeout(PATIENCE);
            }
        }
    }

    /// Passes on all lines but libwayland's, each as it comes.
    fn pass(from: PipeReader, mut to: impl Write) -> io::Result<()> {
        let mut from = BufReader::new(from);
        let mut line = Vec::new();
        while from.read_until(b'\n', &mut line)? > 0 {
            if line.trim_ascii_end() != WAYLAND {
                to.write_all(&line)?;
            }
            line.clear();
        }
        Ok(())
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn one_line_is_left_out() {
            let (reader, mut writer) = pipe().unwrap();
            for line in
                [&b"warning: old driver\n"[..], WAYLAND, b"\n", b"error: XDG_RUNTIME_DIR is odd\nno end"]
            {
                writer.write_all(line).unwrap();
            }
            drop(writer);
            let mut passed = Vec::new();
            pass(reader, &mut passed).unwrap();
            let expected = "warning: old driver\nerror: XDG_RUNTIME_DIR is odd\nno end";
            assert_eq!(String::from_utf8(passed).unwrap(), expected);
        }

        /// Runs itself as a child, whose standard error is a file: a driver prints around Rust's own.
        #[test]
        fn standard_error_is_what_it_was_afterwards() {
            const CHILD: &str = "ISV_TEST_PRINTS_AS_A_DRIVER";
            if std::env::var_os(CHILD).is_some() {
                let print = |line: &[u8]| {
                    let script = format!("echo '{}' >&2", String::from_utf8_lossy(line));
                    assert!(
                        std::process::Command::new("sh").args(["-c", &script]).status().unwrap().success()
                    );
                };
                let filter = Filter::begin().unwrap();
                print(WAYLAND);
                print(b"another");
                drop(filter);
                print(b"afterwards");
                return;
            }
            let mut file = tempfile::tempfile().unwrap();
            let mut child = std::process::Command::new(std::env::current_exe().unwrap());
            child.args([
                "--exact",
                "drivers::unix::tests::standard_error_is_what_it_was_afterwards",
                "--nocapture",
            ]);
            child.env(CHILD, "1").stderr(file.try_clone().unwrap()).stdout(std::process::Stdio::null());
            assert!(child.status().unwrap().success());
            let mut said = String::new();
            io::Seek::rewind(&mut file).unwrap();
            io::Read::read_to_string(&mut file, &mut said).unwrap();
            assert_eq!(said, "another\nafterwards\n");
        }
    }
}
