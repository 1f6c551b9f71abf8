//! What is held against the truth: settings, or the program's own path tracer on a budget.

use std::path::Path;

use chiaro::Settings;

use crate::Error;
use crate::session::counts_in_truth;

/// A way to make a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Technique {
    /// What it is called in tables and files.
    pub label: String,
    /// What it was asked for by.
    pub asked: String,
    /// How.
    pub method: Method,
}

/// How a picture is made.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// By frames with these settings.
    Frames(Box<Settings>),
    /// By paths, as many samples of each pixel as the GPU traces in so many milliseconds, but at least one; filtered along
    /// edges or not.
    Paths {
        /// Of GPU time.
        budget_ms: f64,
        /// Whether the noise is filtered away.
        filtered: bool,
    },
}

const PATHS: &str = "paths:";
/// A minute: who has more takes a truth.
const MOST_MS: f64 = 60_000.0;
/// Letters of a label at most: it names files.
const LONGEST: usize = 100;
/// Names of the report's own files.
const TAKEN: [&str; 2] = ["truth", "results"];
const RAW: &str = ":raw";
/// Stands for a preset among keys.
const PRESET: &str = "preset";

impl Technique {
    /// Reads a preset's name, a `.ron` file, `label:key=value,key=value`, `paths:MS` or `paths:MS:raw`. A preset and a file
    /// begin from the defaults, changes from `base`; what says what is there is that of `base` anyway.
    ///
    /// # Errors
    /// When it is none of these, a file cannot be read, or a key or value is wrong.
    pub fn parse(text: &str, base: &Settings) -> Result<Self, Error> {
        let named = |label: &str, method| Self { label: label.to_owned(), asked: text.to_owned(), method };
        if let Some(rest) = text.strip_prefix(PATHS) {
            let (budget, filtered) = rest.strip_suffix(RAW).map_or((rest, true), |budget| (budget, false));
            let budget_ms = budget.parse().ok().filter(|ms: &f64| *ms > 0.0 && *ms <= MOST_MS);
            let budget_ms = budget_ms.ok_or_else(|| {
                Error::Usage(format!(
                    "--technique {text}: write paths: and milliseconds of GPU time, more than 0 and up to {MOST_MS}, such as paths:2.5, or \
                     paths:2.5:raw for the same without a filter"
                ))
            })?;
            return Ok(named(text, Method::Paths { budget_ms, filtered }));
        }
        let mut settings = Settings { seed: base.seed, ..Settings::default() };
        if is_preset_file(text) && !text.contains('=') {
            apply_preset(&mut settings, text).map_err(|error| error.of(format!("--technique {text}")))?;
            keep_what_is_there(&mut settings, base)?;
            let stem = Path::new(text).file_stem().and_then(|stem| stem.to_str()).unwrap_or(text);
            return Ok(named(stem, Method::Frames(Box::new(settings))));
        }
        let Some((label, changes)) = text.split_once(':') else {
            let presets: Vec<_> = Settings::presets().map(|(name, _)| name).collect();
            if !presets.contains(&text) {
                return Err(Error::Usage(format!(
                    "--technique {text}: it is no preset ({}), no .ron file, no label:key=value,key=value, and no \
                     paths:MILLISECONDS",
                    presets.join(", ")
                )));
            }
            settings.apply_preset(text, None)?;
            keep_what_is_there(&mut settings, base)?;
            return Ok(named(text, Method::Frames(Box::new(settings))));
        };
        let count = label.trim().chars().count();
        if !(1..=LONGEST).contains(&count) || label.contains(char::is_control) {
            return Err(Error::Usage(format!(
                "--technique {text}: a label of 1 to {LONGEST} letters stands before the colon"
            )));
        }
        settings = base.clone();
        let mut pairs: Vec<(&str, String)> = Vec::new();
        for change in changes.split(',').filter(|change| !change.trim().is_empty()) {
            match (change.split_once('='), pairs.last_mut()) {
                (Some((key, value)), _) => pairs.push((key.trim(), value.trim().to_owned())),
                // A value that is a list itself.
                (None, Some((_, value))) => *value = format!("{value},{}", change.trim()),
                (None, None) => {
                    let problem = format!("`{}` is not KEY=VALUE", change.trim());
                    return Err(Error::Usage(format!("--technique {text}: {problem}")));
                }
            }
        }
        for (key, value) in pairs {
            set(&mut settings, key, &value).map_err(|error| error.of(format!("--technique {label}")))?;
        }
        Ok(named(label.trim(), Method::Frames(Box::new(settings))))
    }

    /// Reads several; labels that are the same are told apart by a number.
    ///
    /// # Errors
    /// As [`Technique::parse`].
    pub fn parse_all(texts: &[String], base: &Settings) -> Result<Vec<Self>, Error> {
        let mut all: Vec<Self> = Vec::new();
        for text in texts {
            let mut technique = Self::parse(text, base)?;
            // Some file systems do not tell small letters from capitals.
            let name = |label: &str| file_name(label).to_lowercase();
            let taken = |label: &str| {
                TAKEN.contains(&name(label).as_str())
                    || all.iter().any(|other| name(&other.label) == name(label))
            };
            let numbered = (2..).map(|number| format!("{} {number}", technique.label));
            let label = std::iter::once(technique.label.clone()).chain(numbered).find(|label| !taken(label));
            technique.label = label.unwrap_or_default();
            all.push(technique);
        }
        Ok(all)
    }

    /// The settings, where frames make it.
    pub fn settings(&self) -> Option<&Settings> {
        match &self.method {
            Method::Frames(settings) => Some(settings),
            Method::Paths { .. } => None,
        }
    }

    /// Its label as a part of files' names.
    pub fn file_name(&self) -> String {
        file_name(&self.label)
    }
}

/// One truth is for all: what it depends on is the base's.
fn keep_what_is_there(settings: &mut Settings, base: &Settings) -> Result<(), Error> {
    for field in Settings::fields().iter().filter(|field| counts_in_truth(&field.key)) {
        settings.set(&field.key, &base.get(&field.key).unwrap_or_default())?;
    }
    Ok(())
}

/// Sets a key, or applies a preset by the key `preset`.
///
/// # Errors
/// When the key or the value is wrong.
pub fn set(settings: &mut Settings, key: &str, value: &str) -> Result<(), Error> {
    if key == PRESET { apply_preset(settings, value) } else { Ok(settings.set(key, value)?) }
}

/// Applies a preset by its name, or from a `.ron` file.
///
/// # Errors
/// When the file cannot be read, or a key or value is wrong.
pub fn apply_preset(settings: &mut Settings, preset: &str) -> Result<(), Error> {
    let path = Path::new(preset);
    let read = || std::fs::read_to_string(path).map_err(Error::file("cannot read preset", path));
    let text = is_preset_file(preset).then(read).transpose()?;
    Ok(settings.apply_preset(preset, text.as_deref())?)
}

fn is_preset_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ron"))
}

/// Letters that all file systems take.
pub(crate) fn file_name(label: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() || "-_=.".contains(c) { c } else { '_' };
    let name: String = label.chars().map(letter).collect();
    // No hidden files, and no folder above.
    if name.starts_with('.') { format!("_{name}") } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_technique_is_a_preset_a_file_changes_or_paths() {
        let base = Settings::default();
        let parse = |text: &str| Technique::parse(text, &base);
        assert_eq!(parse("fast").unwrap().label, "fast");
        let soft = parse("soft: shadow.filter=pcss, preset=direct").unwrap();
        assert_eq!(soft.label, "soft");
        let value = |technique: &Technique, key: &str| technique.settings().unwrap().get(key).unwrap();
        assert_eq!(value(&soft, "shadow.filter"), "pcss");
        assert_eq!(value(&soft, "indirect.technique"), "none");
        let split = parse("split:shadow.splits=5,20,60,shadow.cascades=4").unwrap();
        assert_eq!(value(&split, "shadow.cascades"), "4");
        assert!(value(&split, "shadow.splits").contains("20"));
        let paths = |budget_ms, filtered| Method::Paths { budget_ms, filtered };
        assert_eq!(parse("paths:2.5").unwrap().method, paths(2.5, true));
        assert_eq!(parse("paths:8:raw").unwrap().method, paths(8.0, false));
        let file = std::env::temp_dir().join("chiaro_lab_technique.ron");
        std::fs::write(&file, r#"{"shadow.resolution": 512}"#).unwrap();
        let read = parse(file.to_str().unwrap()).unwrap();
        assert_eq!(
            (read.label.as_str(), value(&read, "shadow.resolution").as_str()),
            ("chiaro_lab_technique", "512")
        );
    }

    #[test]
    fn presets_begin_from_the_defaults_and_changes_from_the_base() {
        let mut base = Settings::default();
        base.apply_preset("direct", None).unwrap();
        base.set("environment.sky", "none").unwrap();
        let value = |text: &str, key: &str| {
            Technique::parse(text, &base).unwrap().settings().unwrap().get(key).unwrap()
        };
        assert_eq!(value("default", "indirect.technique"), "auto");
        assert_eq!(value("a:shadow.filter=none", "indirect.technique"), "none");
        // One truth for all.
        assert_eq!(value("default", "environment.sky"), "none");
    }

    #[test]
    fn what_is_no_technique_is_told_with_what_would_be() {
        for (wrong, word) in [
            ("paths:", "milliseconds"),
            ("paths:-1", "milliseconds"),
            ("paths:inf", "milliseconds"),
            ("paths:1e300", "60000"),
            ("slow", "thesis-shadows"),
            (":shadow.filter=none", "label"),
            ("a:shadow.filter", "KEY=VALUE"),
            ("a:shadow.filtre=none", "shadow.filter"),
            ("a:shadow.filter=round", "pcf"),
            ("no/such.ron", "no/such.ron"),
        ] {
            let error = Technique::parse(wrong, &Settings::default()).unwrap_err().to_string();
            assert!(error.contains(word), "{wrong}: {error}");
        }
    }

    #[test]
    fn labels_stay_apart_as_files_too() {
        let texts =
            ["a b:", "a_b:", "A_B:", "default", "default", "..:", "truth:", "results:"].map(str::to_owned);
        let all = Technique::parse_all(&texts, &Settings::default()).unwrap();
        let names: std::collections::BTreeSet<_> = all.iter().map(Technique::file_name).collect();
        assert_eq!(names.len(), 8, "{names:?}");
        assert!(!names.contains("truth") && !names.contains("results"), "{names:?}");
        assert!(names.iter().all(|name| !name.starts_with('.') && !name.contains(['/', ' '])), "{names:?}");
    }
}
