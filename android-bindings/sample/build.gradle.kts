plugins {
    alias(libs.plugins.android)
    alias(libs.plugins.kotlin)
    alias(libs.plugins.compose)
}

android {
    namespace = "org.camssf.sample"
    compileSdk = 36
    defaultConfig {
        applicationId = "org.camssf.sample"
        minSdk = 24
        targetSdk = 36
        versionCode = 1
        versionName = libs.versions.camssf.get()
    }
    buildFeatures {
        compose = true
    }
    sourceSets["main"].kotlin.srcDir("src/main/compose") // apart from src/main/kotlin, which Maven compiles without Compose
    buildTypes {
        release {
            isMinifyEnabled = true // with the rules that camssf's artefacts bring
        }
    }
}

kotlin {
    jvmToolchain(17)
}

dependencies {
    implementation(libs.activity.compose)
    implementation(libs.camera.lifecycle)
    implementation(libs.camera.view)
    implementation(libs.camssf.camerax)
    implementation(libs.compose.foundation)
    implementation(libs.lifecycle)
}
