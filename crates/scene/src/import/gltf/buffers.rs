//! The bytes behind buffer views: from files, data URIs, the GLB's binary chunk, or decompressed.

use std::collections::HashMap;

use ::gltf::buffer::{Source, View};

use super::super::limits::Budget;
use super::super::source::Resource;
use super::file::File;
use super::meshopt;
use crate::SceneError;

/// All bytes of one file.
pub(super) struct Buffers {
    /// `None` for a buffer without data, which may stand for what compressed views decode to.
    buffers: Vec<Option<Vec<u8>>>,
    /// By the view's index.
    decompressed: HashMap<usize, Vec<u8>>,
}

impl Buffers {
    /// Reads every buffer, each at least as long as the document states, and decompresses.
    pub(super) fn read(file: File<'_>, mut blob: Option<Vec<u8>>) -> Result<Self, SceneError> {
        let mut buffers = Vec::new();
        for buffer in file.document.buffers() {
            let place = format!("buffers[{}]", buffer.index());
            let bytes = match buffer.source() {
                Source::Uri(uri) => {
                    Some(Resource::resolve(file.files, file.path, uri, &place)?.into_bytes(file.files)?)
                }
                Source::Bin => blob.take().filter(|_| buffer.index() == 0),
            };
            if let Some(bytes) = bytes.as_ref().filter(|bytes| bytes.len() < buffer.length()) {
                let problem = format!("it states {} bytes but has {}", buffer.length(), bytes.len());
                return Err(file.invalid(place, problem));
            }
            buffers.push(bytes);
        }
        let mut all = Self { buffers, decompressed: HashMap::new() };
        all.decompress(file)?;
        Ok(all)
    }

    fn decompress(&mut self, file: File<'_>) -> Result<(), SceneError> {
        let mut budget = Budget::new(file.limits);
        for view in file.document.views() {
            let Some((extension, json)) =
                meshopt::EXTENSIONS.iter().find_map(|name| Some((*name, view.extension_value(name)?)))
            else {
                continue;
            };
            let place = format!("bufferViews[{}].extensions.{extension}", view.index());
            let stream = meshopt::Stream::from_json(json).map_err(|e| file.invalid(&*place, e))?;
            let end = stream.byte_offset.checked_add(stream.byte_length);
            let encoded = end
                .and_then(|end| self.buffers.get(stream.buffer)?.as_ref()?.get(stream.byte_offset..end))
                .ok_or_else(|| file.invalid(&*place, "it reaches past the end of its buffer"))?;
            let size = stream.size().map_err(|e| file.invalid(&*place, e))?;
            budget
                .spend(|l| &mut l.decompressed, size, "bytes of decompressed buffer views")
                .map_err(|problem| file.invalid(&*place, problem))?;
            let bytes = stream.decode(encoded).map_err(|e| file.invalid(&*place, e))?;
            if bytes.len() < view.length() {
                let problem =
                    format!("it decodes to {} bytes; the view states {}", bytes.len(), view.length());
                return Err(file.invalid(place, problem));
            }
            self.decompressed.insert(view.index(), bytes);
        }
        Ok(())
    }

    /// The bytes of a view, if they are all there.
    pub(super) fn view(&self, view: &View<'_>) -> Option<&[u8]> {
        if let Some(bytes) = self.decompressed.get(&view.index()) {
            return bytes.get(..view.length());
        }
        let end = view.offset().checked_add(view.length())?;
        self.buffers.get(view.buffer().index())?.as_ref()?.get(view.offset()..end)
    }
}
