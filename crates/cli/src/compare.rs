//! `chiaro compare` and `chiaro sweep`

use anyhow::bail;
use chiaro::Settings;
use chiaro_image::read;
use chiaro_lab::session::open_gpu;
use chiaro_lab::{
    Cache, JudgeOptions, Moment, Session, Source, SweepOptions, Technique, TruthOptions, VARIABLE,
};

use crate::args::{CompareArgs, JudgeArgs, SweepArgs};
use crate::asked::{self, choice_of, tell};
use crate::frames;
use crate::output::{WrongUsage, print};

/// What is compared where nobody says.
const TECHNIQUES: [&str; 2] = ["default", "fast"];
/// The truth that is traced.
const FULL: &str = "full";
/// Frames that are timed, with a GPU and without.
const TIMED: [u32; 2] = [100, 5];

pub fn compare(args: &CompareArgs) -> anyhow::Result<()> {
    let base = asked::settings(&args.settings)?;
    let texts = if args.techniques.is_empty() {
        TECHNIQUES.map(str::to_owned).to_vec()
    } else {
        args.techniques.clone()
    };
    let techniques = Technique::parse_all(&texts, &base)?;
    if args.output.is_file() {
        bail!(WrongUsage(format!(
            "-o {}: the report is a folder, but this is a file",
            args.output.display()
        )));
    }
    if args.reference == FULL && args.minus.is_some() {
        bail!(WrongUsage("--minus is subtracted from an image: name it by --reference".to_owned()));
    }
    let cache = cache(&args.judge);
    let source = if args.reference == FULL {
        Source::Full(truth(&args.judge, cache.clone()))
    } else {
        Source::File { path: args.reference.clone().into(), minus: args.minus.clone() }
    };
    let gpu = open_gpu(&mut tell)?;
    let options = judge(&args.judge, cache, gpu.is_software())?;
    let mut session = Session::open_to_compare(&gpu, &asked::choice(&args.scene), base.clone(), &mut tell)?;
    tell_of_rest(&session, &args.judge);
    let report = chiaro_lab::compare(
        &mut session,
        (&techniques, &base),
        (&source, &options),
        &args.output,
        &mut tell,
    )?;
    print(&report.table())?;
    print(&format!("\n{}\n", args.output.join("results.json").display()))
}

pub fn sweep(args: &SweepArgs) -> anyhow::Result<()> {
    let base = asked::settings(&args.settings)?;
    if args.output.is_dir() {
        bail!(WrongUsage(format!("-o {}: rows go to a file, but this is a folder", args.output.display())));
    }
    let cache = cache(&args.judge);
    let gpu = open_gpu(&mut tell)?;
    let options = SweepOptions {
        scenes: args.scenes.iter().map(|scene| choice_of(scene.clone().into(), &args.look)).collect(),
        vary: args.vary.iter().map(|vary| vary.0.clone()).collect(),
        base: Settings::clone(&base),
        judge: judge(&args.judge, cache.clone(), gpu.is_software())?,
        truth: truth(&args.judge, cache),
        shard: args.shard,
    };
    let swept = chiaro_lab::sweep(&gpu, &options, &args.output, &mut tell)?;
    let refused =
        if swept.refused > 0 { format!(" ({} of them refused)", swept.refused) } else { String::new() };
    print(&format!(
        "{}  {} rows written{refused}, {} stood there already\n",
        args.output.display(),
        swept.written,
        swept.skipped
    ))
}

fn truth(args: &JudgeArgs, cache: Option<Cache>) -> TruthOptions {
    let &JudgeArgs { part, target_error, most_samples, diffuse_bounces, .. } = args;
    TruthOptions { part, target_error, most_samples, diffuse_bounces, cache }
}

fn cache(args: &JudgeArgs) -> Option<Cache> {
    if args.no_cache {
        return None;
    }
    let cache = Cache::of_user();
    if cache.is_none() {
        eprintln!("note: there is no folder for caches, so that truths are not kept; {VARIABLE} names one");
    }
    cache
}

fn judge(args: &JudgeArgs, cache: Option<Cache>, is_software: bool) -> anyhow::Result<JudgeOptions> {
    let moment = |moment: frames::Moment| Moment { number: moment.number, time_s: moment.time_s };
    Ok(JudgeOptions {
        part: args.part,
        samples: args.samples,
        seeds: args.seeds,
        moments: frames::moments(&args.time).map(moment).collect(),
        mask: args.mask.as_ref().map(read).transpose()?,
        diffuse_bounces: args.diffuse_bounces,
        cache,
        timed_frames: args.timed_frames.unwrap_or(TIMED[usize::from(is_software)]),
    })
}

fn tell_of_rest(session: &Session, args: &JudgeArgs) {
    if session.duration_s().is_none() && (args.time.frames.is_some() || args.time.time != 0.0) {
        eprintln!("note: nothing in this scene moves; every moment looks the same");
    }
}
