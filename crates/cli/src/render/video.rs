//! Videos by way of ffmpeg, which gets frames through a pipe.

use std::io::{ErrorKind, Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use anyhow::{Context, anyhow, bail};
use chiaro_image::Picture;
use chiaro_lab::files::create_parent;

use crate::args::RenderArgs;
use crate::interrupt::Interrupt;
use crate::output::WrongUsage;
use crate::values::extension;

const FFMPEG: &str = "ffmpeg";
/// What ffmpeg said last tells why it failed.
const LAST_LINES: usize = 4;

/// A kind of video.
#[derive(Clone, Copy, Debug)]
pub enum Format {
    Mp4,
    WebP,
}

impl Format {
    /// The video that is asked for, after making sure that it can be made; none of images.
    pub fn of(args: &RenderArgs) -> anyhow::Result<Option<Self>> {
        let path = args.output.display();
        let format = match extension(&args.output).as_str() {
            "mp4" => Self::Mp4,
            "webp" => Self::WebP,
            _ => return Ok(None),
        };
        if args.time.frames.is_none() {
            bail!(WrongUsage(format!(
                "-o {path}: a video needs --frames A..B; of one moment write a .png or .exr"
            )));
        }
        let size = args.scene.look.size.unwrap_or_default();
        if matches!(format, Self::Mp4) && (size.width % 2 == 1 || size.height % 2 == 1) {
            bail!(WrongUsage(format!("--size {size}: the width and height of an .mp4 are even numbers")));
        }
        if args.output.is_dir() {
            bail!("{path} is a folder; name a file in it");
        }
        let known = Command::new(FFMPEG).arg("-version").stdin(Stdio::null()).output();
        let known = known.map_err(|error| missing(&error, &args.output))?;
        if !known.status.success() {
            bail!(
                "ffmpeg, which {path} needs, does not work: {} ({})",
                last_lines(&known.stderr),
                known.status
            );
        }
        Ok(Some(format))
    }

    /// What ffmpeg is to make of frames.
    fn flags(self) -> &'static [&'static str] {
        match self {
            // Players take the colours of large videos for BT.709's, which ffmpeg does not make unasked.
            Self::Mp4 => &[
                "-vf",
                "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p",
                "-c:v",
                "libx264",
                "-crf",
                "16",
                "-color_range",
                "tv",
                "-colorspace",
                "bt709",
                "-color_primaries",
                "bt709",
                "-color_trc",
                "iec61966-2-1",
                "-movflags",
                "+faststart",
                "-f",
                "mp4",
            ],
            Self::WebP => &["-c:v", "libwebp_anim", "-quality", "90", "-loop", "0", "-f", "webp"],
        }
    }
}

fn missing(error: &std::io::Error, path: &Path) -> anyhow::Error {
    let path = path.display();
    if error.kind() == ErrorKind::NotFound {
        return anyhow!(
            "ffmpeg, which writes {path}, is not on the PATH; install it, or write numbered images (-o NAME.png)"
        );
    }
    anyhow!("ffmpeg, which writes {path}, cannot be started: {error}")
}

/// A video being written: to a file beside its own, which is the video's once it is whole.
pub struct Video {
    ffmpeg: Child,
    frames: Option<ChildStdin>,
    complaints: Option<JoinHandle<Vec<u8>>>,
    part: PathBuf,
    path: PathBuf,
    interrupt: Interrupt,
    added: u64,
}

impl Video {
    pub fn begin(format: Format, path: &Path, [width, height]: [u32; 2], fps: f64) -> anyhow::Result<Self> {
        create_parent(path)?;
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.part", std::process::id()));
        let part = path.with_file_name(name);
        let (to, from) = (path.display(), part.display());
        let interrupt =
            Interrupt::listen(format!("ending {to} with the frames so far, until then in {from}"))?;
        // Whatever the file is called, it is neither a flag nor an address.
        let mut address = std::ffi::OsString::from("file:");
        address.push(&part);
        let (size, fps) = (format!("{width}x{height}"), fps.to_string());
        let mut command = Command::new(FFMPEG);
        command
            .args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pixel_format", "rgb24"])
            .args(["-video_size", &size, "-framerate", &fps, "-i", "pipe:0"])
            .args(format.flags())
            .arg(address)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        apart(&mut command);
        let mut ffmpeg = command.spawn().map_err(|error| missing(&error, path))?;
        let frames = ffmpeg.stdin.take();
        let complaints = ffmpeg.stderr.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut said = Vec::new();
                // What came before a pipe breaks is all there is.
                let _ = pipe.read_to_end(&mut said);
                said
            })
        });
        Ok(Self { ffmpeg, frames, complaints, part, path: path.to_owned(), interrupt, added: 0 })
    }

    /// Adds the next frame, of the video's size.
    pub fn add(&mut self, picture: &Picture) -> anyhow::Result<()> {
        let pipe = self.frames.as_mut().context("the video has ended")?;
        if let Err(error) = pipe.write_all(picture.bytes()) {
            // ffmpeg has left; it says why better than the pipe does.
            self.end()?;
            bail!("cannot hand frame {} of {} to ffmpeg: {error}", self.added, self.path.display());
        }
        self.added += 1;
        Ok(())
    }

    /// Whether Ctrl-C was heard.
    pub fn interrupted(&self) -> bool {
        self.interrupt.heard()
    }

    /// Ends the video, of which `all` frames were to be written.
    pub fn finish(mut self, all: u64) -> anyhow::Result<()> {
        self.end()?;
        let path = self.path.display();
        std::fs::rename(&self.part, &self.path).with_context(|| format!("cannot write {path}"))?;
        if self.added < all {
            bail!("interrupted: {path} holds the first {} of {all} frames", self.added);
        }
        Ok(())
    }

    /// Waits for ffmpeg, which writes what it has.
    fn end(&mut self) -> anyhow::Result<()> {
        drop(self.frames.take());
        let path = self.path.display();
        let status = self.ffmpeg.wait().with_context(|| format!("ffmpeg, writing {path}"))?;
        let said = self.complaints.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        if !status.success() {
            bail!("ffmpeg failed on {path} ({status}): {}", last_lines(&said));
        }
        Ok(())
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        // Nothing of this is left to do once the video is whole.
        let _ = self.ffmpeg.kill();
        let _ = self.ffmpeg.wait();
        let _ = std::fs::remove_file(&self.part);
    }
}

/// A terminal's Ctrl-C is for chiaro alone, which then ends the video.
fn apart(command: &mut Command) {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(windows)]
    std::os::windows::process::CommandExt::creation_flags(command, 0x200);
    #[cfg(not(any(unix, windows)))]
    let _ = command;
}

/// On one line.
fn last_lines(said: &[u8]) -> String {
    let text = String::from_utf8_lossy(said);
    let lines: Vec<_> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    if lines.is_empty() {
        return "it does not say why".to_owned();
    }
    lines[lines.len().saturating_sub(LAST_LINES)..].join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_lines_are_told_on_one() {
        assert_eq!(last_lines(b"a\n\nb\r\nc\n d \ne\n"), "b; c; d; e");
        assert_eq!(last_lines(b"\n"), "it does not say why");
    }
}
