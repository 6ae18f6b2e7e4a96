<?xml version="1.0" encoding="UTF-8"?>
<!--
  Gradle's module metadata, version 1.1, of a published POM: what Gradle reads in the POM's place. It can say what a POM
  cannot: strictly this ONNX Runtime, also where core does not bring it.
-->
<xsl:stylesheet version="1.0" xmlns:xsl="http://www.w3.org/1999/XSL/Transform"
                xmlns:m="http://maven.apache.org/POM/4.0.0">
  <xsl:param name="onnxruntime" />
  <xsl:param name="file" />
  <xsl:param name="size" />
  <xsl:param name="sha1" />
  <xsl:param name="sha256" />
  <xsl:output method="text" encoding="UTF-8" />
  <xsl:variable name="artifact" select="/m:project/m:artifactId" />
  <xsl:variable name="platform" select="/m:project/m:packaging = 'pom'" />

  <xsl:template match="/m:project">
    <xsl:text>{
  "formatVersion": "1.1",
  "component": {
    "group": "</xsl:text><xsl:value-of select="m:groupId" /><xsl:text>",
    "module": "</xsl:text><xsl:value-of select="m:artifactId" /><xsl:text>",
    "version": "</xsl:text><xsl:value-of select="m:version" /><xsl:text>",
    "attributes": {"org.gradle.status": "</xsl:text>
    <xsl:choose>
      <xsl:when test="contains(m:version, '-SNAPSHOT')">integration</xsl:when>
      <xsl:otherwise>release</xsl:otherwise>
    </xsl:choose>
    <xsl:text>"}
  },
  "variants": [
</xsl:text>
    <xsl:call-template name="variant">
      <xsl:with-param name="name">apiElements</xsl:with-param>
      <xsl:with-param name="usage">java-api</xsl:with-param>
      <xsl:with-param name="dependencies" select="m:dependencies/m:dependency[m:scope = 'compile']" />
    </xsl:call-template>
    <xsl:text>,
</xsl:text>
    <xsl:call-template name="variant">
      <xsl:with-param name="name">runtimeElements</xsl:with-param>
      <xsl:with-param name="usage">java-runtime</xsl:with-param>
      <xsl:with-param name="dependencies" select="m:dependencies/m:dependency" />
    </xsl:call-template>
    <xsl:text>
  ]
}
</xsl:text>
  </xsl:template>

  <xsl:template name="variant">
    <xsl:param name="name" />
    <xsl:param name="usage" />
    <xsl:param name="dependencies" />
    <xsl:text>    {
      "name": "</xsl:text><xsl:value-of select="$name" /><xsl:text>",
      "attributes": {
        "org.gradle.category": "</xsl:text>
    <xsl:choose>
      <xsl:when test="$platform">platform</xsl:when>
      <xsl:otherwise>
        <xsl:text>library",
        "org.gradle.dependency.bundling": "external",
        "org.gradle.libraryelements": "</xsl:text>
        <xsl:choose>
          <xsl:when test="/m:project/m:packaging = 'aar'">aar</xsl:when>
          <xsl:otherwise>jar</xsl:otherwise>
        </xsl:choose>
      </xsl:otherwise>
    </xsl:choose>
    <xsl:text>",
        "org.gradle.usage": "</xsl:text><xsl:value-of select="$usage" /><xsl:text>"
      },
      "dependencies": [</xsl:text>
    <xsl:apply-templates select="$dependencies" />
    <xsl:text>],
      "dependencyConstraints": [</xsl:text>
    <xsl:apply-templates select="m:dependencyManagement/m:dependencies/m:dependency" />
    <xsl:if test="$artifact = 'camssf-core'">
      <xsl:call-template name="runtime">
        <xsl:with-param name="of">onnxruntime</xsl:with-param>
      </xsl:call-template>
      <xsl:text>,</xsl:text>
      <xsl:call-template name="runtime">
        <xsl:with-param name="of">onnxruntime-android</xsl:with-param>
      </xsl:call-template>
    </xsl:if>
    <xsl:text>],
      "files": [</xsl:text>
    <xsl:if test="not($platform)">
      <xsl:text>
        {"name": "</xsl:text><xsl:value-of select="$file" /><xsl:text>", "url": "</xsl:text>
      <xsl:value-of select="$file" /><xsl:text>", "size": </xsl:text><xsl:value-of select="$size" />
      <xsl:text>, "sha256": "</xsl:text><xsl:value-of select="$sha256" /><xsl:text>", "sha1": "</xsl:text>
      <xsl:value-of select="$sha1" /><xsl:text>"}
      </xsl:text>
    </xsl:if>
    <xsl:text>]
    }</xsl:text>
  </xsl:template>

  <xsl:template match="m:dependency">
    <xsl:if test="position() > 1">,</xsl:if>
    <xsl:text>
        {"group": "</xsl:text><xsl:value-of select="m:groupId" /><xsl:text>", "module": "</xsl:text>
    <xsl:value-of select="m:artifactId" /><xsl:text>", "version": </xsl:text>
    <xsl:choose>
      <xsl:when test="starts-with(m:version, '[')">
        <xsl:call-template name="strictly" />
      </xsl:when>
      <xsl:otherwise>
        <xsl:text>{"requires": "</xsl:text><xsl:value-of select="m:version" /><xsl:text>"}</xsl:text>
      </xsl:otherwise>
    </xsl:choose>
    <xsl:text>}</xsl:text>
    <xsl:if test="position() = last()"><xsl:text>
      </xsl:text></xsl:if>
  </xsl:template>

  <xsl:template name="runtime">
    <xsl:param name="of" />
    <xsl:text>
        {"group": "com.microsoft.onnxruntime", "module": "</xsl:text><xsl:value-of select="$of" />
    <xsl:text>", "version": </xsl:text>
    <xsl:call-template name="strictly" />
    <xsl:text>, "reason": "later versions report their use to their maker"}</xsl:text>
  </xsl:template>

  <xsl:template name="strictly">
    <xsl:text>{"strictly": "</xsl:text><xsl:value-of select="$onnxruntime" /><xsl:text>", "requires": "</xsl:text>
    <xsl:value-of select="$onnxruntime" /><xsl:text>"}</xsl:text>
  </xsl:template>
</xsl:stylesheet>
