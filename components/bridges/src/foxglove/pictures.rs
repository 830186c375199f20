//! Camera images as Foxglove messages.

use foxglove::messages::RawImage;
use motorium::plan::Plan;
use motorium::state::{ImageInfo, StateBuffer as _, from_bytes};

use super::fields::timestamp;

/// Images on a topic of `u8` slices, whose format the writer publishes on another topic.
#[derive(Debug, Clone)]
pub(super) struct Pictures {
    form_topic: usize,
    form: Option<ImageInfo>,
    /// The frame of the camera: the name of its component.
    frame: String,
}

/// The bytes cannot be drawn as an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// The image format has not been published yet.
    #[error("the image format has not been published yet")]
    NoForm,
    /// The bytes do not match the published format.
    #[error(
        "an image of {width} x {height} pixels in encoding {encoding} has {found} bytes, which does not match its size"
    )]
    Form {
        /// Number of bytes found.
        found: usize,
        /// Published width, pixels.
        width: u32,
        /// Published height, pixels.
        height: u32,
        /// Published pixel encoding, as in [`ImageInfo`].
        encoding: u32,
    },
}

impl Pictures {
    /// Returns the images of a topic if it carries bytes and its writer publishes exactly one image format
    /// topic.
    pub(super) fn of_topic(plan: &Plan, index: usize) -> Option<Self> {
        let topic = plan.topics.get(index).filter(|topic| topic.layout.type_name == u8::NAME)?;
        let writer = plan.components.get(topic.writer)?;
        let of_type = |topic: &usize| {
            plan.topics.get(*topic).is_some_and(|topic| topic.layout.type_name == ImageInfo::NAME)
        };
        let mut forms = writer.outputs.iter().filter_map(|port| port.topic).filter(of_type);
        let form_topic = forms.next().filter(|_| forms.next().is_none())?;
        Some(Self { form_topic, form: None, frame: writer.name.clone() })
    }

    /// Index of the topic with the image format.
    pub(super) fn form_topic(&self) -> usize {
        self.form_topic
    }

    /// Records the image format.
    pub(super) fn note(&mut self, bytes: &[u8]) {
        self.form = from_bytes(bytes).or(self.form);
    }

    /// Returns the message of an image. An image with one byte per pixel is greyscale, regardless of the
    /// announced format.
    pub(super) fn image(&self, bytes: &[u8], time_ns: u64) -> Result<RawImage, PictureError> {
        let ImageInfo { width, height, stride, encoding, .. } = self.form.ok_or(PictureError::NoForm)?;
        let is_of = |stride: u32| u64::from(stride) * u64::from(height) == bytes.len() as u64;
        let (name, step) = match encoding {
            ImageInfo::RGB_8 if is_of(stride) => ("rgb8", stride),
            ImageInfo::BGR_8 if is_of(stride) => ("bgr8", stride),
            ImageInfo::DEPTH_32 if is_of(stride) => ("32FC1", stride),
            ImageInfo::GREY_8 if is_of(stride) => ("mono8", stride),
            ImageInfo::RGB_8 | ImageInfo::BGR_8 | ImageInfo::DEPTH_32 if is_of(width) => ("mono8", width),
            _ => return Err(PictureError::Form { found: bytes.len(), width, height, encoding }),
        };
        Ok(RawImage {
            timestamp: Some(timestamp(time_ns)),
            frame_id: self.frame.clone(),
            width,
            height,
            encoding: name.to_string(),
            step,
            data: bytes.to_vec().into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures(encoding: u32, stride: u32) -> Pictures {
        let form = ImageInfo { width: 4, height: 2, stride, encoding, ..ImageInfo::default() };
        Pictures { form_topic: 0, form: Some(form), frame: "eye".to_string() }
    }

    #[test]
    fn image_encoding_follows_its_form() {
        for (encoding, stride, bytes, name) in [
            (ImageInfo::RGB_8, 12, 24, "rgb8"),
            (ImageInfo::BGR_8, 16, 32, "bgr8"),
            (ImageInfo::GREY_8, 4, 8, "mono8"),
            (ImageInfo::DEPTH_32, 16, 32, "32FC1"),
            (ImageInfo::DEPTH_32, 16, 8, "mono8"),
        ] {
            let image = pictures(encoding, stride).image(&vec![7; bytes], 1_500_000_000).unwrap();
            assert_eq!((image.encoding.as_str(), image.step as usize * 2), (name, bytes));
            assert_eq!(
                (image.width, image.height, image.frame_id.as_str(), image.data.len()),
                (4, 2, "eye", bytes)
            );
            assert_eq!(image.timestamp.map(|time| (time.sec(), time.nsec())), Some((1, 500_000_000)));
        }
    }

    #[test]
    fn corrupt_bytes_and_files_are_not_pictures() {
        let error = pictures(ImageInfo::RGB_8, 12).image(&[0; 23], 0).unwrap_err();
        assert!(error.to_string().contains("23 bytes"), "{error}");
        assert!(pictures(ImageInfo::JPEG, 0).image(&[0; 8], 0).is_err());
        let unknown = Pictures { form: None, ..pictures(ImageInfo::RGB_8, 12) };
        assert_eq!(unknown.image(&[0; 24], 0), Err(PictureError::NoForm));
    }
}
