package org.camssf.photo

/** Metadata of a photo, without its samples. */
internal class Facts(
    val origin: Mosaic.Origin,
    val width: Int,
    val height: Int,
    val sensor: Mosaic.Sensor,
    val corrections: Mosaic.Corrections,
    val colours: Mosaic.Colours,
) {
    val name: String get() = origin.name

    /** The whole active area. */
    val area: Region get() = Region(0, 0, width, height)

    /** The part of `region` that lies in the photo. */
    fun clipped(region: Region): Region = region.within(width, height)

    /** A mosaic with this metadata and these samples. */
    fun mosaic(region: Region, samples: ShortArray): Mosaic =
        Mosaic(origin, width, height, region, samples, sensor, corrections, colours)
}
