//! The product of scenes and values, a row each, in a file that may be begun, stopped and gone on with.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use chiaro::scene::text_hash;
use chiaro::{Gpu, Settings, Shard};
use serde::Serialize;

use crate::files::{bar, create_parent};
use crate::judge::{JudgeOptions, judge};
use crate::row::Columns;
use crate::row_file::{append, known};
use crate::session::{SceneChoice, Tell, by_key, truth_settings};
use crate::technique::{Method, Technique, set};
use crate::truth::Truth;
use crate::truths::{TruthOptions, Truths};
use crate::{Error, Session};

/// A key and the values that it is to have: a setting's, or `preset`, `size` or `samples`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Vary {
    /// What varies.
    pub key: String,
    /// In this order.
    pub values: Vec<String>,
}

/// What one row is of.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Combination {
    scene: usize,
    values: Vec<(String, String)>,
}

/// What is swept.
#[derive(Clone, Debug)]
pub struct SweepOptions {
    /// Scenes, the slowest to vary.
    pub scenes: Vec<SceneChoice>,
    /// Keys, the last one the fastest.
    pub vary: Vec<Vary>,
    /// All other settings.
    pub base: Settings,
    /// How rows are judged.
    pub judge: JudgeOptions,
    /// What they are held against.
    pub truth: TruthOptions,
    /// Which rows are this run's.
    pub shard: Option<Shard>,
}

/// What a sweep did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Swept {
    /// Rows written by this run.
    pub written: usize,
    /// Rows that stood there already.
    pub skipped: usize,
    /// Of those written, rows of settings that do not go together.
    pub refused: usize,
}

#[derive(Serialize)]
struct Row<'a> {
    id: &'a str,
    vary: BTreeMap<&'a str, &'a str>,
    /// Those that are not the defaults.
    settings: BTreeMap<String, String>,
    /// What the renderer gave up.
    notes: &'a [String],
    #[serde(flatten)]
    columns: Option<Columns>,
    /// Why there are no figures.
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

/// What is asked of a row beyond its settings.
#[derive(Clone, Debug)]
struct Asked {
    settings: Settings,
    size: Option<[u32; 2]>,
    samples: Option<u32>,
}

/// Combinations at most.
const MOST: usize = 1_000_000;
/// Keys that are no settings.
const SIZE: &str = "size";
const SAMPLES: &str = "samples";

/// Sweeps: appends a row of JSON to the file for each combination of the shard that it does not hold yet. Settings that do not
/// go together make a row that says so.
///
/// # Errors
/// When a key or value is wrong (before anything is measured), a scene cannot be read, the device fails, or the file cannot be
/// written.
pub fn sweep(gpu: &Gpu, options: &SweepOptions, path: &Path, tell: Tell<'_>) -> Result<Swept, Error> {
    check(options)?;
    let mine = mine(options);
    create_parent(path)?;
    let known = known(path)?;
    let progress = bar(mine.len() as u64, "sweeping {bar:40} {pos}/{len} rows, {eta} left  {msg}");
    let mut swept = Swept::default();
    for (index, choice) in options.scenes.iter().enumerate() {
        let of_scene: Vec<_> = mine.iter().filter(|combination| combination.scene == index).collect();
        if of_scene.is_empty() {
            continue;
        }
        let session = Session::open_to_compare(gpu, choice, options.base.clone(), tell)
            .map_err(|error| error.of(choice.source.to_string()))?;
        let mut open = OfScene::new(session, options);
        for combination in of_scene {
            let text = words(&combination.values);
            progress.set_message(text.clone());
            let row =
                open.row((options, &known), &combination.values, tell).map_err(|error| error.of(text))?;
            match row {
                None => swept.skipped += 1,
                Some((line, refused)) => {
                    append(path, &line)?;
                    swept.written += 1;
                    swept.refused += usize::from(refused);
                }
            }
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    Ok(swept)
}

/// Makes sure that all keys and values are right, and that no row is asked for twice.
fn check(options: &SweepOptions) -> Result<(), Error> {
    let mut keys = BTreeSet::new();
    let mut count = options.scenes.len();
    for Vary { key, values } in &options.vary {
        if !keys.insert(key) {
            return Err(Error::Usage(format!(
                "--vary {key}: it is given twice; write all its values at once"
            )));
        }
        let mut seen = BTreeSet::new();
        for value in values {
            if !seen.insert(value) {
                return Err(Error::Usage(format!("--vary {key}: {value} is given twice")));
            }
            asked(&options.base, &[(key.clone(), value.clone())])?;
        }
        count = count.saturating_mul(values.len());
    }
    if count > MOST {
        return Err(Error::Usage(format!("these are {count} combinations, more than the {MOST} of a sweep")));
    }
    let mut scenes = BTreeSet::new();
    for scene in &options.scenes {
        let name = scene.source.to_string();
        if !name.starts_with("builtin:") && !Path::new(&name).exists() {
            return Err(Error::Work(format!("{name}: there is no such file")));
        }
        if !scenes.insert(name.clone()) {
            return Err(Error::Usage(format!("{name} is given twice")));
        }
    }
    Ok(())
}

/// A scene that is open, and its truths.
struct OfScene {
    session: Session,
    size: [u32; 2],
    truths: Truths,
    // Of the last row, by what it depends on: neighbouring rows have the same.
    last: Option<(String, Vec<Truth>)>,
}

impl OfScene {
    fn new(session: Session, options: &SweepOptions) -> Self {
        let truths = Truths::new(&session, options.truth.clone());
        Self { size: session.size, session, truths, last: None }
    }

    /// A row as a line of JSON, and whether it was refused; `None` if it is known.
    fn row(
        &mut self,
        (options, known): (&SweepOptions, &BTreeSet<String>),
        values: &[(String, String)],
        tell: Tell<'_>,
    ) -> Result<Option<(String, bool)>, Error> {
        let text = words(values);
        let asked = asked(&options.base, values)?;
        self.session.size = asked.size.unwrap_or(self.size);
        let judge_options =
            JudgeOptions { samples: asked.samples.or(options.judge.samples), ..options.judge.clone() };
        let id = id(&self.session, &asked, (&text, options, &judge_options));
        if known.contains(&id) {
            return Ok(None);
        }
        let truths = self.truths_of(&asked.settings, &judge_options, tell)?;
        let method = Method::Frames(Box::new(asked.settings.clone()));
        let technique = Technique { label: text.clone(), asked: text.clone(), method };
        let by = (&technique, &asked.settings);
        let judged = judge(&mut self.session, by, &truths, &judge_options, &mut |_, _, _| Ok(()));
        let floor = truths.first().and_then(|truth| truth.floor(judge_options.mask.as_ref()));
        self.last = self.last.take().map(|(key, _)| (key, truths));
        let (columns, refused) = match judged {
            Ok(judged) => (Some(Columns::new(&text, &self.session, &judge_options, &judged, floor)), None),
            Err(error) if error.is_of_row() => (None, Some(error.to_string())),
            Err(error) => return Err(error),
        };
        let is_refused = refused.is_some();
        let row = Row {
            id: &id,
            vary: by_name(values),
            settings: unlike_defaults(&asked.settings),
            notes: self.session.notes(),
            columns,
            refused,
        };
        Ok(Some((serde_json::to_string(&row)?, is_refused)))
    }

    /// The truths of all moments, those of the last row if they are the same.
    fn truths_of(
        &mut self,
        settings: &Settings,
        options: &JudgeOptions,
        tell: Tell<'_>,
    ) -> Result<Vec<Truth>, Error> {
        let key = format!("{:?} {}", self.session.size, truth_settings(settings));
        if let Some((_, truths)) = self.last.take().filter(|(known, _)| *known == key) {
            self.last = Some((key, Vec::new()));
            return Ok(truths);
        }
        let mut all = Vec::new();
        for moment in &options.moments {
            self.session.go_to(moment.time_s)?;
            all.push(self.truths.of((&self.session, settings), moment.time_s, tell)?);
        }
        self.last = Some((key, Vec::new()));
        Ok(all)
    }
}

/// All combinations, scene by scene, the last key the fastest.
fn combinations(options: &SweepOptions) -> Vec<Combination> {
    let mut all: Vec<Combination> =
        (0..options.scenes.len()).map(|scene| Combination { scene, values: Vec::new() }).collect();
    for Vary { key, values } in &options.vary {
        let longer = |combination: &Combination| {
            let combination = combination.clone();
            values.iter().map(move |value| {
                let mut combination = combination.clone();
                combination.values.push((key.clone(), value.clone()));
                combination
            })
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}

fn mine(options: &SweepOptions) -> Vec<Combination> {
    let is_mine = |index: usize| {
        options.shard.is_none_or(|Shard { number, of }| index as u32 % of.max(1) == number.saturating_sub(1))
    };
    let all = combinations(options).into_iter().enumerate();
    all.filter(|(index, _)| is_mine(*index)).map(|(_, combination)| combination).collect()
}

/// Applies values to the base, in their order.
fn asked(base: &Settings, values: &[(String, String)]) -> Result<Asked, Error> {
    let mut asked = Asked { settings: base.clone(), size: None, samples: None };
    for (key, value) in values {
        let wrong = |advice: &str| Error::Usage(format!("--vary {key}={value}: {advice}"));
        match key.as_str() {
            SIZE => {
                let side = |text: &str| text.parse().ok().filter(|side| (1..=8192).contains(side));
                let size = value.split_once('x').and_then(|(w, h)| Some([side(w)?, side(h)?]));
                asked.size = Some(size.ok_or_else(|| wrong("write two whole numbers such as 640x360"))?);
            }
            SAMPLES => {
                let number = value.parse().ok().filter(|number| *number > 0);
                asked.samples = Some(number.ok_or_else(|| wrong("write a whole number from 1"))?);
            }
            _ => set(&mut asked.settings, key, value).map_err(|error| error.of("--vary"))?,
        }
    }
    Ok(asked)
}

fn words(values: &[(String, String)]) -> String {
    let all: Vec<_> = values.iter().map(|(key, value)| format!("{key}={value}")).collect();
    if all.is_empty() { "base".to_owned() } else { all.join(" ") }
}

fn unlike_defaults(settings: &Settings) -> BTreeMap<String, String> {
    let defaults = by_key(&Settings::default());
    let all = by_key(settings).into_iter();
    all.filter(|(key, value)| defaults.get(key) != Some(value)).collect()
}

fn by_name(values: &[(String, String)]) -> BTreeMap<&str, &str> {
    values.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect()
}

/// Of all that a row's errors depend on.
fn id(
    session: &Session,
    asked: &Asked,
    (text, options, judge): (&str, &SweepOptions, &JudgeOptions),
) -> String {
    let TruthOptions { part, diffuse_bounces, target_error, most_samples, .. } = &options.truth;
    let JudgeOptions { samples, seeds, moments, mask, timed_frames, .. } = judge;
    let mask = mask.as_ref().map(|mask| {
        let bytes: Vec<_> =
            mask.pixels().iter().map(|p| u8::from(p.iter().all(|v| *v <= 0.0)).to_string()).collect();
        text_hash(&bytes.concat())
    });
    let all = format!(
        "{} {text} {} {:016x} {} {:?} {:?} seed {} {part:?} {diffuse_bounces:?} {target_error} {most_samples} {samples:?} \
         {seeds} {moments:?} {mask:?} {timed_frames} {:?} {}",
        env!("CARGO_PKG_VERSION"),
        session.scene_name,
        session.source.fingerprint(),
        crate::session::camera_text(&session.view),
        session.size,
        session.source.origin,
        asked.settings.seed,
        by_key(&asked.settings),
        session.gpu.info.name,
    );
    format!("{:016x}", text_hash(&all))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_settings_presets_sizes_and_samples() {
        let values = |pairs: &[(&str, &str)]| -> Vec<(String, String)> {
            pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
        };
        let base = Settings::default();
        let found = asked(
            &base,
            &values(&[("preset", "fast"), ("shadow.resolution", "512"), ("size", "64x48"), ("samples", "4")]),
        )
        .unwrap();
        assert_eq!((found.size, found.samples), (Some([64, 48]), Some(4)));
        assert_eq!(found.settings.get("shadow.resolution").as_deref(), Some("512"));
        assert_eq!(found.settings.get("shadow.pcf_kernel").as_deref(), Some("2"));
        for wrong in [
            ("size", "64"),
            ("samples", "0"),
            ("shadow.filter", "round"),
            ("preset", "slow"),
            ("no.key", "1"),
        ] {
            assert!(asked(&base, &values(&[wrong])).unwrap_err().is_usage(), "{wrong:?}");
        }
    }
}
