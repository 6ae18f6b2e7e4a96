package org.camssf

// The names of before the rooms, for one release; Kotlin only: Java has no such aliases and names the room.

/** Now [org.camssf.photo.Assumption]. */
@Deprecated("Now in the room photo.", ReplaceWith("Assumption", "org.camssf.photo.Assumption"))
public typealias Assumption = org.camssf.photo.Assumption

/** Now [org.camssf.photo.BadPixels]. */
@Deprecated("Now in the room photo.", ReplaceWith("BadPixels", "org.camssf.photo.BadPixels"))
public typealias BadPixels = org.camssf.photo.BadPixels

/** Now [org.camssf.photo.Capture]. */
@Deprecated("Now in the room photo.", ReplaceWith("Capture", "org.camssf.photo.Capture"))
public typealias Capture = org.camssf.photo.Capture

/** Now [org.camssf.spectra.ChartLayout]. */
@Deprecated("Now in the room spectra.", ReplaceWith("ChartLayout", "org.camssf.spectra.ChartLayout"))
public typealias ChartLayout = org.camssf.spectra.ChartLayout

/** Now [org.camssf.photo.ChartPose]. */
@Deprecated("Now in the room photo.", ReplaceWith("ChartPose", "org.camssf.photo.ChartPose"))
public typealias ChartPose = org.camssf.photo.ChartPose

/** Now [org.camssf.spectra.ChartTable]. */
@Deprecated("Now in the room spectra.", ReplaceWith("ChartTable", "org.camssf.spectra.ChartTable"))
public typealias ChartTable = org.camssf.spectra.ChartTable

/** Now [org.camssf.photo.dng.DngReader]. */
@Deprecated("Now in the room photo.dng.", ReplaceWith("DngReader", "org.camssf.photo.dng.DngReader"))
public typealias DngReader = org.camssf.photo.dng.DngReader

/** Now [org.camssf.photo.dng.DngSource]. */
@Deprecated("Now in the room photo.dng.", ReplaceWith("DngSource", "org.camssf.photo.dng.DngSource"))
public typealias DngSource = org.camssf.photo.dng.DngSource

/** Now [org.camssf.photo.PhotoSource]. */
@Deprecated("Now PhotoSource, in the room photo.", ReplaceWith("PhotoSource", "org.camssf.photo.PhotoSource"))
public typealias Frame = org.camssf.photo.PhotoSource

/** Now [org.camssf.photo.FrameMeans]. */
@Deprecated("Now in the room photo.", ReplaceWith("FrameMeans", "org.camssf.photo.FrameMeans"))
public typealias FrameMeans = org.camssf.photo.FrameMeans

/** Now [org.camssf.photo.GainMap]. */
@Deprecated("Now in the room photo.", ReplaceWith("GainMap", "org.camssf.photo.GainMap"))
public typealias GainMap = org.camssf.photo.GainMap

/** Now [org.camssf.spectra.Lamp]. */
@Deprecated("Now in the room spectra.", ReplaceWith("Lamp", "org.camssf.spectra.Lamp"))
public typealias Lamp = org.camssf.spectra.Lamp

/** Now [org.camssf.photo.LensShading]. */
@Deprecated("Now in the room photo.", ReplaceWith("LensShading", "org.camssf.photo.LensShading"))
public typealias LensShading = org.camssf.photo.LensShading

/** Now [org.camssf.photo.MeasuredCapture]. */
@Deprecated("Now in the room photo.", ReplaceWith("MeasuredCapture", "org.camssf.photo.MeasuredCapture"))
public typealias MeasuredCapture = org.camssf.photo.MeasuredCapture

/** Now [org.camssf.photo.MeasuredShot]. */
@Deprecated("Now in the room photo.", ReplaceWith("MeasuredShot", "org.camssf.photo.MeasuredShot"))
public typealias MeasuredShot = org.camssf.photo.MeasuredShot

/** Now [org.camssf.photo.Mosaic]. */
@Deprecated("Now in the room photo.", ReplaceWith("Mosaic", "org.camssf.photo.Mosaic"))
public typealias Mosaic = org.camssf.photo.Mosaic

/** Now [org.camssf.photo.Neutral]. */
@Deprecated("Now in the room photo.", ReplaceWith("Neutral", "org.camssf.photo.Neutral"))
public typealias Neutral = org.camssf.photo.Neutral

/** Now [org.camssf.photo.PatchMeans]. */
@Deprecated("Now in the room photo.", ReplaceWith("PatchMeans", "org.camssf.photo.PatchMeans"))
public typealias PatchMeans = org.camssf.photo.PatchMeans

/** Now [org.camssf.photo.Photo]. */
@Deprecated("Now in the room photo.", ReplaceWith("Photo", "org.camssf.photo.Photo"))
public typealias Photo = org.camssf.photo.Photo

/** Now [org.camssf.evidence.Reason]. */
@Deprecated("Now in the room evidence.", ReplaceWith("Reason", "org.camssf.evidence.Reason"))
public typealias Reason = org.camssf.evidence.Reason

/** Now [org.camssf.photo.Region]. */
@Deprecated("Now in the room photo.", ReplaceWith("Region", "org.camssf.photo.Region"))
public typealias Region = org.camssf.photo.Region

/** Now [org.camssf.evidence.Scores]. */
@Deprecated("Now in the room evidence.", ReplaceWith("Scores", "org.camssf.evidence.Scores"))
public typealias Scores = org.camssf.evidence.Scores

/** Now [org.camssf.photo.Shot]. */
@Deprecated("Now in the room photo.", ReplaceWith("Shot", "org.camssf.photo.Shot"))
public typealias Shot = org.camssf.photo.Shot

/** Now [org.camssf.photo.Signals]. */
@Deprecated("Now in the room photo.", ReplaceWith("Signals", "org.camssf.photo.Signals"))
public typealias Signals = org.camssf.photo.Signals

/** Now [org.camssf.spectra.SourceFile]. */
@Deprecated("Now in the room spectra.", ReplaceWith("SourceFile", "org.camssf.spectra.SourceFile"))
public typealias SourceFile = org.camssf.spectra.SourceFile

/** Now [org.camssf.curves.Ssf]. */
@Deprecated("Now in the room curves.", ReplaceWith("Ssf", "org.camssf.curves.Ssf"))
public typealias Ssf = org.camssf.curves.Ssf

/** Now [org.camssf.evidence.Verdict]. */
@Deprecated("Now in the room evidence.", ReplaceWith("Verdict", "org.camssf.evidence.Verdict"))
public typealias Verdict = org.camssf.evidence.Verdict
