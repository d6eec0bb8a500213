//! Periodic progress on standard error, for commands that print nothing else for a long time.

use crate::stderr::tell;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two lines where there is no terminal: a log shows that the command is running, and stays short.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// A moving line on a terminal, otherwise a line now and then, otherwise nothing.
pub(crate) struct WaitingProgress(Shown);

enum Shown {
    Bar(ProgressBar),
    Lines { message: Arc<Mutex<String>>, stop: Option<Sender<()>>, thread: Option<JoinHandle<()>> },
    Nothing,
}

impl WaitingProgress {
    /// Begins; `quiet` shows nothing.
    pub(crate) fn start(quiet: bool) -> Self {
        if quiet {
            return Self(Shown::Nothing);
        }
        if std::io::stderr().is_terminal() {
            let style =
                ProgressStyle::with_template("{spinner} {elapsed}  {msg}").expect("the template is a constant");
            let bar = ProgressBar::new_spinner().with_style(style);
            bar.enable_steady_tick(Duration::from_millis(200));
            return Self(Shown::Bar(bar));
        }
        Self(Self::lines(BETWEEN_LINES, |line| tell(line)))
    }

    fn lines(every: Duration, mut write: impl FnMut(&str) + Send + 'static) -> Shown {
        let message: Arc<Mutex<String>> = Arc::default();
        let (stop, stopped) = channel::<()>();
        let (shared, begun) = (Arc::clone(&message), Instant::now());
        let thread = std::thread::Builder::new().name("progress_line".into()).spawn(move || {
            while stopped.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
                let now = shared.lock().unwrap_or_else(PoisonError::into_inner).clone();
                write(&format!("{:.0} s  {now}", begun.elapsed().as_secs_f64()));
            }
        });
        // Without a thread there are no progress lines; the command itself is not harmed.
        thread.map_or(Shown::Nothing, |thread| Shown::Lines { message, stop: Some(stop), thread: Some(thread) })
    }

    /// Says something that stays; a moving line makes way for it.
    pub(crate) fn say(&self, text: impl std::fmt::Display) {
        match &self.0 {
            Shown::Bar(bar) => bar.suspend(|| tell(text)),
            Shown::Lines { .. } | Shown::Nothing => tell(text),
        }
    }

    /// Sets the text that is shown.
    pub(crate) fn set(&self, text: String) {
        match &self.0 {
            Shown::Bar(bar) => bar.set_message(text),
            Shown::Lines { message, .. } => *message.lock().unwrap_or_else(PoisonError::into_inner) = text,
            Shown::Nothing => {}
        }
    }
}

impl Drop for WaitingProgress {
    fn drop(&mut self) {
        match &mut self.0 {
            Shown::Bar(bar) => bar.finish_and_clear(),
            Shown::Lines { stop, thread, .. } => {
                *stop = None;
                if let Some(thread) = thread.take() {
                    let _ = thread.join();
                }
            }
            Shown::Nothing => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_terminal_a_line_comes_now_and_then_and_none_after_the_end() {
        let (sender, lines) = channel();
        let progress_line = WaitingProgress(WaitingProgress::lines(Duration::from_millis(10), move |line| {
            sender.send(line.to_owned()).unwrap()
        }));
        progress_line.set("row 3 of 40".to_owned());
        let line = lines.iter().find(|line| line.contains("row")).unwrap();
        assert_eq!(line, "0 s  row 3 of 40");
        drop(progress_line);
        assert_eq!(lines.iter().filter(|line| !line.contains("row 3 of 40")).count(), 0, "the sender has gone");
    }
}
