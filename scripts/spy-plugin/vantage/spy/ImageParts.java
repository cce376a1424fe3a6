package vantage.spy;

import java.awt.Color;
import java.awt.image.BufferedImage;
import java.io.ByteArrayInputStream;
import java.io.IOException;
import javax.imageio.ImageIO;
import vantage.image_part_t;

/** Puts the parts of one channel's newest image together. */
final class ImageParts {
    private static final int MAX_BYTES = 32 << 20;
    private static final int NEAR_MM = 300, FAR_MM = 3000; // Colours of depth: red to blue.

    private long utime = Long.MIN_VALUE;
    private byte[] bytes = new byte[0];
    private boolean[] there = new boolean[0];
    private int missing;

    /** The image this part completes, null while there are more to come. Parts of older images are passed over. */
    BufferedImage add(image_part_t part) throws IOException {
        if (part.parts < 1 || part.part < 0 || part.part >= part.parts || part.total_size < 1 || part.total_size > MAX_BYTES) {
            throw new IOException("a part that contradicts itself");
        }
        boolean started_again = part.utime < utime - 5000000;
        if (part.utime < utime && !started_again) return null;
        if (part.utime != utime || part.parts != there.length || part.total_size != bytes.length) {
            utime = part.utime;
            bytes = new byte[part.total_size];
            there = new boolean[part.parts];
            missing = part.parts;
        }
        // Parts are equally large, but for the last.
        int offset = part.part == part.parts - 1 ? bytes.length - part.size : part.part * part.size;
        if (there[part.part] || part.size < 0 || offset < 0 || offset + part.size > bytes.length) return null;
        System.arraycopy(part.data, 0, bytes, offset, part.size);
        there[part.part] = true;
        return --missing == 0 ? decode(part) : null;
    }

    private BufferedImage decode(image_part_t part) throws IOException {
        int width = part.camera.width, height = part.camera.height;
        switch (part.encoding) {
            case image_part_t.JPEG:
            case image_part_t.PNG:
                BufferedImage image = ImageIO.read(new ByteArrayInputStream(bytes));
                if (image == null) throw new IOException("neither JPEG nor PNG");
                return image;
            case image_part_t.DEPTH_RVL:
                DepthCodec depth = new DepthCodec(bytes);
                return colours(depth.width, depth.height, depth.millimetres);
            case image_part_t.RAW_BGR:
                if (width < 1 || height < 1 || (long) width * height * 3 != bytes.length) throw new IOException("raw colour of another size");
                BufferedImage raw = new BufferedImage(width, height, BufferedImage.TYPE_3BYTE_BGR);
                raw.getRaster().setDataElements(0, 0, width, height, swapped());
                return raw;
            case image_part_t.RAW_DEPTH:
                if (width < 1 || height < 1 || (long) width * height * 2 != bytes.length) throw new IOException("raw depth of another size");
                char[] millimetres = new char[width * height];
                for (int i = 0; i < millimetres.length; ++i) {
                    millimetres[i] = (char) ((bytes[2 * i] & 255) | (bytes[2 * i + 1] & 255) << 8);
                }
                return colours(width, height, millimetres);
            default:
                throw new IOException("encoding " + part.encoding + " is not known");
        }
    }

    /** The raster's elements are red, green, blue, ours blue, green, red. */
    private byte[] swapped() {
        byte[] rgb = bytes.clone();
        for (int i = 0; i + 2 < rgb.length; i += 3) {
            rgb[i] = bytes[i + 2];
            rgb[i + 2] = bytes[i];
        }
        return rgb;
    }

    private static BufferedImage colours(int width, int height, char[] millimetres) {
        int[] of_share = new int[256];
        for (int i = 0; i < 256; ++i) of_share[i] = Color.HSBtoRGB(0.7f * i / 255, 0.9f, 0.95f);
        BufferedImage image = new BufferedImage(width, height, BufferedImage.TYPE_INT_RGB);
        for (int i = 0; i < millimetres.length; ++i) {
            int mm = millimetres[i];
            int share = Math.max(0, Math.min(255, (mm - NEAR_MM) * 255 / (FAR_MM - NEAR_MM)));
            image.setRGB(i % width, i / width, mm == 0 ? 0x303030 : of_share[share]);
        }
        return image;
    }
}
